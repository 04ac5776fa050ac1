import pickle
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from grouser.surrogate import ACTIVATIONS, Activation, NativeSurrogate, Surrogate, TorchSurrogate, torch_network
from grouser.terrain import (
    MODES,
    ArtifactError,
    ConfigurationError,
    FloatArray,
    ForceBackend,
    InvalidInputError,
    Mode,
    TrackedVehicle,
    make_backend,
)

Make = Callable[..., Surrogate]
Rows = Callable[..., tuple[Any, Any]]
BACKENDS = (NativeSurrogate, TorchSurrogate)


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest, make_surrogate: Make, m113: TrackedVehicle) -> ForceBackend:
    built: ForceBackend = request.param(m113, "rigid", make_surrogate())
    return built


@pytest.fixture
def rows(driving_rows: Rows, m113: TrackedVehicle) -> FloatArray:
    x: FloatArray = driving_rows(m113, "rigid", runs=3, seed=7)[0]
    return x


def _reference_jacobian(surrogate: Surrogate, x: FloatArray) -> FloatArray:
    """The float64 oracle's Jacobian, by torch."""
    rows = torch.tensor(x, requires_grad=True)
    forces = surrogate.evaluate(torch_network(), rows)
    np.testing.assert_allclose(forces.detach().numpy(), surrogate.reference_forces(x), rtol=1e-10, atol=1e-6)
    parts = [torch.autograd.grad(forces[:, i].sum(), rows, retain_graph=True)[0] for i in range(3)]
    jacobian: FloatArray = torch.stack(parts, dim=1).numpy()
    return jacobian


@pytest.mark.parametrize("kind", BACKENDS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_forces_and_jacobians_agree_with_the_oracle(
    make_surrogate: Make, driving_rows: Rows, m113: TrackedVehicle, kind: Any, mode: Mode, activation: Activation
) -> None:
    surrogate = make_surrogate(mode, activation, (128, 128))
    x, _ = driving_rows(m113, mode, runs=4, seed=3)
    expected = surrogate.reference_forces(x)
    backend = kind(m113, mode, surrogate)
    spread = expected.std(axis=0)
    assert abs((backend.forces(x) - expected) / spread).max() < 1e-5

    forces, jacobian = backend.forces_and_jacobian(x)
    assert jacobian.shape == (len(x), 3, x.shape[1])
    assert abs((forces - expected) / spread).max() < 1e-5
    error = (jacobian - _reference_jacobian(surrogate, x)) * surrogate.input_normalizer.scale / spread[:, None]
    assert abs(error).max() < 1e-3


def test_single_rows_and_batches_agree(backend: ForceBackend, rows: FloatArray) -> None:
    one, many = backend.forces(rows[5]), backend.forces(rows)
    assert one.shape == (3,)
    assert one.dtype == many.dtype == np.float64
    np.testing.assert_allclose(one, many[5], rtol=1e-4, atol=1e-5 * many.std())
    forces, jacobian = backend.forces_and_jacobian(rows[5])
    assert (forces.shape, jacobian.shape) == ((3,), (3, 10))
    np.testing.assert_allclose(
        jacobian, backend.forces_and_jacobian(rows)[1][5], rtol=1e-3, atol=1e-4 * abs(jacobian).max()
    )


def test_no_rows_give_no_forces(backend: ForceBackend) -> None:
    forces, jacobian = backend.forces_and_jacobian(np.empty((0, 10)))
    assert (forces.shape, jacobian.shape) == ((0, 3), (0, 3, 10))
    assert backend.forces(np.empty((0, 10))).shape == (0, 3)


def test_other_layouts_are_converted(backend: ForceBackend, rows: FloatArray) -> None:
    expected = backend.forces(rows)
    read_only = rows.copy()
    read_only.setflags(write=False)
    for same in (np.asfortranarray(rows), rows.tolist(), read_only, np.repeat(rows, 2, axis=0)[::2]):
        np.testing.assert_array_equal(backend.forces(same), expected)
        np.testing.assert_array_equal(backend.forces_and_jacobian(same)[0].shape, expected.shape)
    single = rows.astype(np.float32)
    np.testing.assert_array_equal(backend.forces(single), backend.forces(single.astype(np.float64)))  # type: ignore[arg-type]


def test_the_input_is_left_as_it_was(backend: ForceBackend, rows: FloatArray) -> None:
    before = rows.copy()
    forces, _ = backend.forces_and_jacobian(rows)
    forces += 1.0
    backend.forces(rows)
    np.testing.assert_array_equal(rows, before)


@pytest.mark.parametrize("method", ["forces", "forces_and_jacobian"])
@pytest.mark.parametrize("x", [np.zeros(9), np.zeros(20), np.zeros((2, 11)), np.zeros((2, 5)), 3.0, ["a"] * 10, None])
def test_wrong_shapes_are_refused(backend: ForceBackend, method: str, x: Any) -> None:
    with pytest.raises(InvalidInputError):
        getattr(backend, method)(x)


@pytest.mark.parametrize("method", ["forces", "forces_and_jacobian"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(
    backend: ForceBackend, rows: FloatArray, method: str, bad: float
) -> None:
    rows[1, 8] = bad
    with pytest.raises(InvalidInputError, match="fr"):
        getattr(backend, method)(rows)
    with pytest.raises(InvalidInputError, match="fr"):
        getattr(backend, method)(rows[1])


def test_pickling_keeps_the_forces(backend: ForceBackend, rows: FloatArray) -> None:
    again = pickle.loads(pickle.dumps(backend))
    assert type(again) is type(backend)
    assert again.describe() == backend.describe()
    np.testing.assert_array_equal(again.forces(rows), backend.forces(rows))


def test_four_threads_give_the_results_of_one(backend: ForceBackend, rows: FloatArray) -> None:
    expected = backend.forces_and_jacobian(rows)
    with ThreadPoolExecutor(4) as pool:
        for forces, jacobian in pool.map(lambda _: backend.forces_and_jacobian(rows), range(16)):
            np.testing.assert_array_equal(forces, expected[0])
            np.testing.assert_array_equal(jacobian, expected[1])


def test_the_resolution_is_that_of_float32(backend: ForceBackend) -> None:
    assert backend.resolution == np.finfo(np.float32).eps


def test_tracks_are_refused(backend: ForceBackend, rows: FloatArray) -> None:
    assert not backend.has_track_forces
    with pytest.raises(ConfigurationError, match="has_track_forces"):
        backend.track_forces(rows, rows)


@pytest.mark.parametrize("name", ["native", "torch"])
def test_backends_are_made_by_name_from_a_path(
    make_surrogate: Make, tmp_path: Path, rows: FloatArray, name: str
) -> None:
    surrogate = make_surrogate()
    path = surrogate.save(tmp_path / "a.safetensors")
    backend = make_backend(name, mode="rigid", vehicle="m113", artifact=str(path))
    assert backend.describe() == {
        "backend": name,
        "mode": "rigid",
        "vehicle": "m113",
        "artifact": surrogate.content_hash,
    }
    expected = surrogate.reference_forces(rows)
    assert abs((backend.forces(rows) - expected) / expected.std(axis=0)).max() < 1e-5


@pytest.mark.parametrize("name", ["native", "torch", "guarded"])
def test_an_artifact_of_another_mode_or_vehicle_is_refused(make_surrogate: Make, name: str) -> None:
    surrogate = make_surrogate()
    with pytest.raises(ArtifactError, match="asked for m113 on soil"):
        make_backend(name, mode="soil", vehicle="m113", artifact=surrogate)
    with pytest.raises(ArtifactError, match="asked for ugv on rigid"):
        make_backend(name, mode="rigid", vehicle="ugv", artifact=surrogate)


def test_an_unknown_option_is_refused(make_surrogate: Make) -> None:
    with pytest.raises(ConfigurationError, match="artefact"):
        make_backend("native", mode="rigid", artefact=make_surrogate())


def test_a_network_too_wide_for_the_compiled_one(make_surrogate: Make, m113: TrackedVehicle) -> None:
    surrogate = make_surrogate(hidden=(513,))
    with pytest.raises(ConfigurationError, match="use 'torch'"):
        NativeSurrogate(m113, "rigid", surrogate)
    TorchSurrogate(m113, "rigid", surrogate)


def test_torch_is_asked_for_by_name(
    make_surrogate: Make, m113: TrackedVehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    surrogate = make_surrogate()
    monkeypatch.setattr("grouser.surrogate.network.find_spec", lambda name: None)
    with pytest.raises(ConfigurationError, match=r"grouser\[torch\]"):
        TorchSurrogate(m113, "rigid", surrogate)


def test_importing_the_package_needs_neither_torch_nor_casadi() -> None:
    import subprocess

    code = "import sys, grouser.surrogate; sys.exit(bool({'torch', 'casadi'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-P", "-c", code], check=False).returncode == 0
