import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grouser.surrogate import ACTIVATIONS, Activation, DenseNetwork, Normalizer, Surrogate, artifact, container
from grouser.terrain import (
    MODES,
    ArtifactError,
    ConfigurationError,
    InvalidInputError,
    Mode,
    TrackedVehicle,
    parameter_ranges,
)

Make = Callable[..., Surrogate]
Rows = Callable[..., tuple[Any, Any]]


@pytest.fixture
def saved(make_surrogate: Make, tmp_path: Path) -> Path:
    return make_surrogate().save(tmp_path / "m113-rigid.safetensors")


def _rewrite(path: Path, change: Callable[[dict[str, Any], dict[str, Any]], None]) -> Path:
    """Change tensors and metadata and seal them with a hash that fits, as another program might."""
    tensors, metadata = container.unpack(path.read_bytes(), str(path), artifact.FORMAT_VERSION)
    tensors = {name: array.copy() for name, array in tensors.items()}
    change(tensors, metadata)
    path.write_bytes(container.pack(tensors, metadata))
    return path


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_a_file_gives_the_surrogate_back(
    make_surrogate: Make, driving_rows: Rows, tmp_path: Path, mode: Mode, activation: Activation
) -> None:
    surrogate = make_surrogate(mode, activation)
    again = Surrogate.load(surrogate.save(tmp_path / "a.safetensors"))
    assert again.content_hash == surrogate.content_hash
    assert again.vehicle == surrogate.vehicle
    assert again.ranges == surrogate.ranges
    assert (again.mode, again.range_name, again.dataset_hash) == (mode, "wide", "0" * 64)
    assert (again.recipe, again.metrics) == (surrogate.recipe, surrogate.metrics)
    assert again.detector.summary() == surrogate.detector.summary()
    x, _ = driving_rows(surrogate.vehicle, mode, runs=3)
    np.testing.assert_array_equal(again.reference_forces(x), surrogate.reference_forces(x))
    np.testing.assert_array_equal(again.detector.score(x), surrogate.detector.score(x))


def test_equal_content_gives_equal_bytes(make_surrogate: Make, tmp_path: Path) -> None:
    surrogate = make_surrogate()
    reordered = replace(surrogate, recipe=dict(reversed(list(surrogate.recipe.items()))))
    files = [one.save(tmp_path / f"{i}.safetensors").read_bytes() for i, one in enumerate((surrogate, reordered))]
    assert files[0] == files[1]


def test_the_content_hash_tells_weights_and_metadata_apart(make_surrogate: Make) -> None:
    surrogate = make_surrogate()
    weights = [array.copy() for array in surrogate.network.weights]
    weights[0][0, 0] += np.float32(1e-3)
    network = DenseNetwork("silu", tuple(weights), surrogate.network.biases)
    others = [replace(surrogate, network=network), surrogate.with_metrics({"r2": 0.5})]
    assert len({one.content_hash for one in (surrogate, *others)}) == 3


def test_saving_leaves_nothing_else_behind(saved: Path) -> None:
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_a_failed_save_keeps_the_old_file(make_surrogate: Make, saved: Path) -> None:
    before = saved.read_bytes()
    with pytest.raises(ArtifactError, match="finite numbers"):
        make_surrogate().with_metrics({"r2": np.nan}).save(saved)
    with pytest.raises(ArtifactError, match="not JSON serializable"):
        make_surrogate().with_metrics({"r2": np.zeros(3)}).save(saved)
    assert saved.read_bytes() == before


def test_an_artifact_has_its_suffix(make_surrogate: Make, tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match=r"ends in \.safetensors, got 'a\.pt'"):
        make_surrogate().save(tmp_path / "a.pt")


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match=r"cannot read artifact .*No such file"):
        Surrogate.load(tmp_path / "none.safetensors")


@pytest.mark.parametrize("keep", [0, 4, 100, -1])
def test_a_truncated_file(saved: Path, keep: int) -> None:
    saved.write_bytes(saved.read_bytes()[:keep])
    with pytest.raises(ArtifactError, match="truncated or not a safetensors file"):
        Surrogate.load(saved)


def test_another_kind_of_file(saved: Path) -> None:
    saved.write_text("no surrogate, but a letter of some length")
    with pytest.raises(ArtifactError, match="truncated or not a safetensors file"):
        Surrogate.load(saved)


def test_a_safetensors_file_of_another_program(saved: Path) -> None:
    from safetensors.numpy import save

    saved.write_bytes(save({"weights": np.zeros(3)}, {"format": "pt"}))
    with pytest.raises(ArtifactError, match="lacks grouser's metadata"):
        Surrogate.load(saved)


def test_a_flipped_byte_in_the_weights(saved: Path) -> None:
    data = bytearray(saved.read_bytes())
    data[-1] ^= 1
    saved.write_bytes(data)
    with pytest.raises(ArtifactError, match="was altered"):
        Surrogate.load(saved)


def test_edited_metadata(saved: Path) -> None:
    data = saved.read_bytes()
    size = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + size])
    metadata = json.loads(header["__metadata__"]["grouser"])
    metadata["metrics"]["r2"] = [0.99, 0.99, 0.99]
    header["__metadata__"]["grouser"] = json.dumps(metadata)
    edited = json.dumps(header).encode()
    saved.write_bytes(struct.pack("<Q", len(edited)) + edited + data[8 + size :])
    with pytest.raises(ArtifactError, match="was altered"):
        Surrogate.load(saved)


def test_a_newer_format(saved: Path) -> None:
    def change(tensors: dict[str, Any], metadata: dict[str, Any]) -> None:
        metadata["format_version"] = 99

    with pytest.raises(ArtifactError, match="format version 99, this grouser reads 1 to 1; upgrade"):
        Surrogate.load(_rewrite(saved, change))


@pytest.mark.parametrize("key", ["vehicle", "mode", "inputs", "activation", "layers", "detector", "ranges", "recipe"])
def test_a_missing_key(saved: Path, key: str) -> None:
    with pytest.raises(ArtifactError, match=f"lacks '{key}'"):
        Surrogate.load(_rewrite(saved, lambda tensors, metadata: metadata.pop(key)))


@pytest.mark.parametrize("name", ["network.1.biases", "input.mean", "output.scale", "detector.whitening"])
def test_a_missing_tensor(saved: Path, name: str) -> None:
    with pytest.raises(ArtifactError, match=f"lacks '{name}'"):
        Surrogate.load(_rewrite(saved, lambda tensors, metadata: tensors.pop(name)))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["network.0.weights", "network.2.biases", "input.mean", "detector.center"])
def test_values_that_are_not_finite(saved: Path, name: str, bad: float) -> None:
    def change(tensors: dict[str, Any], metadata: dict[str, Any]) -> None:
        tensors[name].flat[0] = bad

    with pytest.raises(ArtifactError, match=r"does not hold a surrogate: .*finite"):
        Surrogate.load(_rewrite(saved, change))


@pytest.mark.parametrize(
    "name", ["network.0.weights", "network.2.biases", "input.mean", "output.scale", "detector.low"]
)
def test_wrong_shapes(saved: Path, name: str) -> None:
    def change(tensors: dict[str, Any], metadata: dict[str, Any]) -> None:
        tensors[name] = np.ascontiguousarray(tensors[name][:-1])

    with pytest.raises(ArtifactError, match="does not hold a surrogate"):
        Surrogate.load(_rewrite(saved, change))


def test_wrong_types(saved: Path) -> None:
    def change(tensors: dict[str, Any], metadata: dict[str, Any]) -> None:
        tensors["input.mean"] = tensors["input.mean"].astype(np.float32)

    with pytest.raises(ArtifactError, match=r"input\.mean must be float64, got float32"):
        Surrogate.load(_rewrite(saved, change))


def test_other_columns(saved: Path) -> None:
    def change(tensors: dict[str, Any], metadata: dict[str, Any]) -> None:
        metadata["inputs"] = metadata["inputs"][::-1]

    with pytest.raises(ArtifactError, match="not those of the rigid interface"):
        Surrogate.load(_rewrite(saved, change))


def test_an_unknown_feature_map(make_surrogate: Make) -> None:
    with pytest.raises(ArtifactError, match=r"unknown feature map 'slipp' \(known: interface, track\)"):
        replace(make_surrogate(), feature_map="slipp")


def test_parts_must_fit_together(make_surrogate: Make) -> None:
    rigid, soil = make_surrogate("rigid"), make_surrogate("soil")
    with pytest.raises(ArtifactError, match="detector and ranges of its mode"):
        replace(rigid, detector=soil.detector)
    with pytest.raises(ArtifactError, match="detector and ranges of its mode"):
        replace(rigid, ranges=parameter_ranges("wide", "soil"))
    with pytest.raises(ArtifactError, match="10 network inputs, got 11"):
        replace(rigid, network=soil.network)
    with pytest.raises(ArtifactError, match="10 input normalizer columns, got 11"):
        replace(rigid, input_normalizer=soil.input_normalizer)
    with pytest.raises(ArtifactError, match="3 output normalizer columns, got 2"):
        replace(rigid, output_normalizer=Normalizer(np.zeros(2), np.ones(2)))


def test_require_refuses_another_mode(make_surrogate: Make, m113: TrackedVehicle) -> None:
    with pytest.raises(ArtifactError, match="for m113 on rigid ground, asked for m113 on soil ground"):
        make_surrogate().require(m113, "soil")


def test_require_refuses_another_vehicle(make_surrogate: Make, m113: TrackedVehicle) -> None:
    surrogate = make_surrogate()
    with pytest.raises(ArtifactError, match="asked for marder"):
        surrogate.require(TrackedVehicle.preset("marder"), "rigid")
    with pytest.raises(ArtifactError, match="another mass or geometry"):
        surrogate.require(replace(m113, mass=11301.0), "rigid")


def test_require_accepts_another_drive(make_surrogate: Make, m113: TrackedVehicle) -> None:
    surrogate = make_surrogate()
    assert surrogate.require(replace(m113, name="mine", belt_time_constant=0.5), "rigid") is surrogate


def test_nothing_shipped_says_what_is_and_how_to_make_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(artifact, "_artifacts", lambda: tmp_path / "none")
    with pytest.raises(ArtifactError, match=r"for m113 on rigid ground \(shipped: none\).*grouser train"):
        Surrogate.shipped("m113", "rigid")


def test_shipped_artifacts_are_found_by_vehicle_and_mode(
    make_surrogate: Make, m113: TrackedVehicle, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    surrogate = make_surrogate()
    surrogate.save(tmp_path / "m113-rigid.safetensors")
    monkeypatch.setattr(artifact, "_artifacts", lambda: tmp_path)
    assert Surrogate.shipped("m113", "rigid").content_hash == surrogate.content_hash
    assert Surrogate.resolve(m113, "rigid").content_hash == surrogate.content_hash
    with pytest.raises(ArtifactError, match=r"\(shipped: m113-rigid\)"):
        Surrogate.shipped(m113, "soil")
    with pytest.raises(ArtifactError, match="another mass or geometry"):
        Surrogate.shipped(replace(m113, mass=9000.0), "rigid")
    with pytest.raises(ConfigurationError, match="did you mean 'rigid'"):
        Surrogate.shipped("m113", "rigit")


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_casadi_agrees_with_the_oracle(
    make_surrogate: Make, driving_rows: Rows, mode: Mode, activation: Activation
) -> None:
    surrogate = make_surrogate(mode, activation)
    x, _ = driving_rows(surrogate.vehicle, mode, runs=3)
    function = surrogate.casadi()
    assert (function.size_in(0), function.size_out(0)) == ((surrogate.interface.size, 1), (3, 1))
    expected = surrogate.reference_forces(x)
    error = (np.array(function(x.T)).T - expected) / expected.std(axis=0)
    assert abs(error).max() < 1e-9


@pytest.mark.parametrize(
    "x",
    [np.zeros(9), np.zeros((2, 11)), np.zeros((2, 2, 10)), np.full(10, np.nan), np.full((2, 10), np.inf), ["a"] * 10],
)
def test_the_oracle_refuses_bad_rows(make_surrogate: Make, x: Any) -> None:
    with pytest.raises(InvalidInputError):
        make_surrogate().reference_forces(x)
