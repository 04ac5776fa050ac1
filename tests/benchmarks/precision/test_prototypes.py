"""The prototypes in C compute the format that they are named after."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.precision.prototypes import PROTOTYPES, Prototype, processor
from benchmarks.precision.speed import OURS, Subject, drawn_subjects, hidden_values, speed
from grouser.controllers.bench.subjects import Subjects
from grouser.controllers.bench.toolchain import Toolchain
from grouser.surrogate import NUMPY_NETWORK, Surrogate
from grouser.terrain import ConfigurationError, TrackedVehicle

# A sum in another order moves an activation across the edge of a step, now and then.
TOLERANCES = {"float32": 1e-4, "bfloat16": 2e-2, "int8": 5e-2}
BYTES = {"float32": 4, "float16": 2, "bfloat16": 2, "int8": 1}


@pytest.fixture(scope="module")
def subject() -> Subject:
    return drawn_subjects(["64x64"])[0]


@pytest.fixture(scope="module")
def toolchain() -> Toolchain:
    found = Toolchain.find()
    if found is None:
        pytest.skip("no C compiler")
    return found


@pytest.fixture(scope="module")
def features(toolchain: Toolchain, tmp_path_factory: pytest.TempPathFactory) -> frozenset[str]:
    try:
        return processor(toolchain, tmp_path_factory.mktemp("processor"))
    except ConfigurationError:
        return frozenset()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("prototypes")


@pytest.mark.parametrize("prototype", PROTOTYPES, ids=lambda prototype: prototype.name)
@pytest.mark.parametrize("hidden", [(64, 64), (24, 40)], ids=str)
def test_a_prototype_computes_its_format(
    prototype: Prototype, hidden: tuple[int, ...], toolchain: Toolchain, features: frozenset[str], folder: Path
) -> None:
    if prototype.needs not in features:
        pytest.skip(f"the processor has no {prototype.needs}")
    subjects = Subjects(TrackedVehicle.preset("m113"))
    surrogate, rows = subjects.plain(hidden), subjects.rows[::8]
    expected = surrogate.evaluate(NUMPY_NETWORK, rows, prototype.kind.forward(surrogate.network))
    forces = prototype.compile(toolchain, folder, f"{hidden[0]}", surrogate).forces(rows)
    error = np.abs(forces - expected) / expected.std(axis=0)
    assert float(error.max()) < TOLERANCES[prototype.kind.activations]


@pytest.mark.parametrize("prototype", PROTOTYPES, ids=lambda prototype: prototype.name)
def test_weights_take_the_bytes_of_their_format(prototype: Prototype, subject: Subject) -> None:
    first, second, last = prototype.layers(subject.surrogate)
    size = BYTES[prototype.kind.weights]
    assert first.weights.nbytes == (size if prototype.kind.first else 4) * 10 * 64
    assert second.weights.nbytes == size * 64 * 64
    assert last.weights.nbytes == size * 64 * 16


def test_a_processor_without_the_instructions_is_no_crash(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("benchmarks.precision.speed.processor", lambda *_: frozenset())
    monkeypatch.setattr(Toolchain, "find", lambda: Toolchain("none", "none 1.0"))
    found = speed([], 1, tmp_path, lambda *_: None)
    assert found["absent"] == {each.name: f"the processor has no {each.needs}" for each in PROTOTYPES}


def test_a_compiler_for_another_processor_is_no_crash(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(*_: object) -> frozenset[str]:
        raise ConfigurationError("cc refuses: what is avx512f?")

    monkeypatch.setattr("benchmarks.precision.speed.processor", refuse)
    monkeypatch.setattr(Toolchain, "find", lambda: Toolchain("none", "none 1.0"))
    assert speed([], 1, tmp_path, lambda *_: None)["absent"]["prototypes in C"] == "cc refuses: what is avx512f?"


def test_without_a_compiler_the_projects_own_kernel_is_timed(
    subject: Subject, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(Toolchain, "find", lambda: None)
    found = speed([subject], 1, tmp_path, lambda *_: None)
    assert list(found["ns"]["64x64"]) == [OURS]
    assert "prototypes in C" in found["absent"]


def test_prototypes_are_for_plain_networks_with_relu(toolchain: Toolchain, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="plain networks with ReLU"):
        PROTOTYPES[0].compile(toolchain, tmp_path, "silu", Surrogate.load("m113-rigid"))


def test_every_drawn_unit_is_silent_on_half_of_the_rows(subject: Subject) -> None:
    z = subject.surrogate.input_normalizer.normalize(subject.rows)
    for values in hidden_values(subject.surrogate.network, z):
        np.testing.assert_allclose(np.mean(values <= 1e-6 * values.max(), axis=0), 0.5, atol=0.02)
    np.testing.assert_allclose(subject.silence, 0.5, atol=0.02)
