"""A terrain field in a file: to the bit and back, and every damaged or foreign file refused by its name."""

import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grouser.terrain import (
    MODES,
    FloatArray,
    InvalidInputError,
    Mode,
    TerrainField,
    interface,
    load_field,
    named,
    parameter_ranges,
    resolve_ground,
    save_field,
)

every_mode = pytest.mark.parametrize("mode", MODES)


def varied(mode: Mode = "rigid", **changes: Any) -> TerrainField:
    rng = np.random.default_rng(0)
    ranges = parameter_ranges("wide", mode)
    cells = np.array([[ranges.sample(rng).parameters for _ in range(5)] for _ in range(4)])
    return TerrainField(mode, (-1 / 3, 0.1), 0.7, cells, **changes)


def contents(mode: Mode = "rigid") -> dict[str, Any]:
    """The arrays of a field's file, written down from the documentation."""
    field = varied(mode)
    return {
        "mode": np.array(mode),
        "origin": np.array(field.origin),
        "spacing": np.array(field.spacing),
        "parameter_names": np.array(interface(mode).parameter_names),
        "parameters": field.parameters,
    }


def write(file: Path, arrays: dict[str, Any]) -> Path:
    np.savez(file, **arrays)
    return file


def assert_same_field(actual: TerrainField, expected: TerrainField) -> None:
    assert (actual.mode, actual.origin, actual.spacing, actual.outside) == (
        expected.mode,
        expected.origin,
        expected.spacing,
        expected.outside,
    )
    assert actual.parameters.tobytes() == expected.parameters.tobytes()
    assert (actual.elevation is None) == (expected.elevation is None)
    if actual.elevation is not None and expected.elevation is not None:
        assert actual.elevation.tobytes() == expected.elevation.tobytes()


# Round trip


@every_mode
@pytest.mark.parametrize("outside", ["refuse", "extend"])
@pytest.mark.parametrize("hilly", [False, True])
def test_a_field_comes_back_to_the_bit(tmp_path: Path, mode: Mode, outside: Any, hilly: bool) -> None:
    heights: FloatArray | None = np.random.default_rng(1).normal(size=(4, 5)) if hilly else None
    field = varied(mode, outside=outside, elevation=heights)
    file = save_field(field, tmp_path / "ground.npz")
    assert file == tmp_path / "ground.npz"
    assert os.listdir(tmp_path) == ["ground.npz"]  # nothing half written beside it
    loaded = load_field(file)
    assert_same_field(loaded, field)
    assert loaded.parameters_at(1.234, 1.7).tobytes() == field.parameters_at(1.234, 1.7).tobytes()


def test_a_file_replaces_another_and_makes_its_folder(tmp_path: Path) -> None:
    file = tmp_path / "new" / "ground.npz"
    save_field(varied("soil"), file)
    save_field(varied("rigid"), str(file))
    assert load_field(str(file)).mode == "rigid"


@every_mode
def test_a_file_by_the_documentation_is_read(tmp_path: Path, mode: Mode) -> None:
    assert_same_field(load_field(write(tmp_path / "mine.npz", contents(mode))), varied(mode))


def test_the_file_names_its_arrays_and_needs_no_pickle(tmp_path: Path) -> None:
    file = save_field(varied("soil"), tmp_path / "ground.npz")
    with np.load(file, allow_pickle=False) as archive:
        assert str(archive["mode"]) == "soil"
        assert archive["parameter_names"].tolist() == ["c", "phi", "fr", "k"]
        assert archive["parameters"].shape == (4, 5, 4)
        assert str(archive["outside"]) == "refuse"


@pytest.mark.parametrize("kind", [str, Path])
def test_a_ground_is_given_by_its_file(tmp_path: Path, kind: Any) -> None:
    file = save_field(varied(), tmp_path / "ground.npz")
    resolved = resolve_ground(kind(file))
    assert isinstance(resolved, TerrainField)
    assert_same_field(resolved, varied())


# What is refused


def refused(file: Path, reason: str) -> None:
    """Refused, and the file closed again: one that is left open is reported as a warning."""
    with pytest.raises(InvalidInputError, match=reason) as caught:
        load_field(file)
    assert str(file) in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    refused(tmp_path / "nothing.npz", "No such file")
    refused(tmp_path, "cannot read")


@pytest.mark.parametrize("content", [b"", b"PK", b"ground", b"\x93NUMPY\x01\x00", b"\x80\x04N."])
def test_a_file_that_is_no_archive(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "ground.npz"
    file.write_bytes(content)
    refused(file, "not an .npz file of plain arrays")


def test_a_single_array(tmp_path: Path) -> None:
    file = tmp_path / "ground.npz"
    with file.open("wb") as stream:
        np.save(stream, varied().parameters)
    refused(file, "not an .npz file")


def test_a_truncated_file(tmp_path: Path) -> None:
    whole = save_field(varied(), tmp_path / "ground.npz").read_bytes()
    file = tmp_path / "part.npz"
    for length in range(1, len(whole), 41):
        file.write_bytes(whole[:length])
        refused(file, "not an .npz file")


def test_a_file_with_a_wrong_byte_is_read_right_or_refused(tmp_path: Path) -> None:
    """An archive's checksums cover its arrays, not its dates; no other error may come out, at any byte."""
    whole = save_field(varied(), tmp_path / "ground.npz").read_bytes()
    file = tmp_path / "bad.npz"
    refusals = []
    for position in range(len(whole)):
        damaged = bytearray(whole)
        damaged[position] ^= 0xFF
        file.write_bytes(damaged)
        try:
            loaded = load_field(file)
        except InvalidInputError as error:
            refusals.append(str(error))
        else:
            assert_same_field(loaded, varied())
    assert len(refusals) > len(whole) / 2
    assert all(str(file) in message for message in refusals)


def test_an_encrypted_member(tmp_path: Path) -> None:
    file = save_field(varied(), tmp_path / "ground.npz")
    data = bytearray(file.read_bytes())
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = data.find(signature)
        data[at + offset] |= 1  # the flag of encryption
    file.write_bytes(data)
    refused(file, "not an .npz file")


def test_an_array_of_objects_is_not_unpickled(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> Any:
            return os.mkdir, (str(tmp_path / "executed"),)

    arrays = contents() | {"origin": np.array([Trap(), Trap()], dtype=object)}
    refused(write(tmp_path / "ground.npz", arrays), "allow_pickle=False")
    assert not (tmp_path / "executed").exists()


def test_a_member_that_is_no_array(tmp_path: Path) -> None:
    file = write(tmp_path / "ground.npz", contents())
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("notes.txt", "hello")
    refused(file, "notes")


@pytest.mark.parametrize("name", ["mode", "origin", "spacing", "parameter_names", "parameters"])
def test_a_missing_array(tmp_path: Path, name: str) -> None:
    arrays = {key: value for key, value in contents().items() if key != name}
    refused(write(tmp_path / "ground.npz", arrays), f"it lacks {name}$")


def test_every_missing_array_is_named(tmp_path: Path) -> None:
    refused(
        write(tmp_path / "ground.npz", {"parameters": varied().parameters}),
        "it lacks mode, origin, spacing, parameter_names$",
    )


def test_an_unknown_array_is_answered_with_the_nearest(tmp_path: Path) -> None:
    arrays = contents() | {"elevations": np.zeros((4, 5))}
    refused(write(tmp_path / "ground.npz", arrays), "unknown array of a terrain field 'elevations'.*'elevation'")


@pytest.mark.parametrize(
    "names", [("fr", "mu", "k"), ("mu", "fr"), ("mu", "fr", "k", "c"), ("c", "phi", "fr", "k"), ("MU", "fr", "k")]
)
def test_parameter_names_of_another_order_or_mode(tmp_path: Path, names: tuple[str, ...]) -> None:
    arrays = contents() | {"parameter_names": np.array(names)}
    refused(
        write(tmp_path / "ground.npz", arrays), f"parameters of a rigid field are mu, fr, k, got {', '.join(names)}"
    )


def with_bad_cell() -> FloatArray:
    cells = varied().parameters.copy()
    cells[3, 2, 0] = -1.0
    return cells


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"mode": np.array("ridgid")}, "did you mean 'rigid'"),
        ({"mode": np.array(0)}, "unknown terrain mode"),
        ({"origin": np.zeros(3)}, ""),
        ({"origin": np.array(1.0)}, ""),
        ({"origin": np.array([0.0, np.nan])}, "origin must be a finite pair"),
        ({"spacing": np.array(0.0)}, "spacing must lie in"),
        ({"spacing": np.array([1.0, 1.0])}, ""),
        ({"spacing": np.array("wide")}, ""),
        ({"parameter_names": np.array("mu")}, ""),
        ({"parameters": np.zeros((4, 5))}, "got shape"),
        ({"parameters": np.full((4, 5, 3), "a")}, ""),
        ({"parameters": with_bad_cell()}, "row 3, column 2 of the field: mu must lie in"),
        ({"elevation": np.zeros((5, 4))}, "4 x 5 cells, got shape"),
        ({"outside": np.array("extended")}, "did you mean 'extend'"),
    ],
)
def test_arrays_that_hold_no_field(tmp_path: Path, changes: dict[str, Any], reason: str) -> None:
    refused(write(tmp_path / "ground.npz", contents() | changes), f"is not a terrain field: .*{reason}")


def test_complex_numbers_are_no_parameters(tmp_path: Path) -> None:
    arrays = contents() | {"parameters": varied().parameters + 0.5j}
    refused(write(tmp_path / "ground.npz", arrays), "is not a terrain field")


def test_numbers_of_another_kind_are_widened(tmp_path: Path) -> None:
    buffer = contents() | {"parameters": varied().parameters.astype(np.float32), "origin": np.array([1, 2])}
    field = load_field(write(tmp_path / "ground.npz", buffer))
    assert field.parameters.dtype == np.float64
    assert field.origin == (1.0, 2.0)
    np.testing.assert_array_equal(field.parameters, varied().parameters.astype(np.float32))


def test_the_named_ground_of_a_uniform_file_is_returned(tmp_path: Path) -> None:
    field = TerrainField.uniform(named("ice"), (0.0, 10.0, 0.0, 10.0))
    loaded = load_field(save_field(field, tmp_path / "ice.npz"))
    np.testing.assert_array_equal(loaded.parameters_at(3.3, 4.4), named("ice").parameters)


def test_fortran_ordered_arrays_are_the_same_field(tmp_path: Path) -> None:
    arrays = contents() | {"parameters": np.asfortranarray(varied().parameters)}
    assert_same_field(load_field(write(tmp_path / "ground.npz", arrays)), varied())
