"""What can be exported, under which name, and into which folder."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grouser.surrogate import DenseNetwork, Surrogate, export_c
from grouser.surrogate.track_model import FEATURES
from grouser.terrain import ConfigurationError, InvalidInputError, SwitchingPolicy


@pytest.fixture(scope="module")
def rigid() -> Surrogate:
    return Surrogate.load("m113-rigid")


def test_the_name_is_vehicle_and_mode_unless_another_is_given(rigid: Surrogate, tmp_path: Path) -> None:
    assert (export_c(rigid, tmp_path / "a") / "grouser_m113_rigid.c").is_file()
    other = export_c(rigid, tmp_path / "b", name="Track-Model.2")
    header = (other / "grouser_track_model_2.h").read_text()
    assert "int grouser_track_model_2_self_test(void);" in header
    assert "GROUSER_TRACK_MODEL_2_ABI_VERSION" in header


@pytest.mark.parametrize("name", ["", "2nd", "größe", "a/b", "../x", "a" * 70])
def test_a_name_that_c_cannot_have_is_refused(rigid: Surrogate, tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigurationError, match="letters, digits and underscores"):
        export_c(rigid, tmp_path / "x", name=name)
    assert not list(tmp_path.iterdir())


def test_a_name_of_the_core_is_a_name_too(rigid: Surrogate, tmp_path: Path) -> None:
    header = (export_c(rigid, tmp_path / "a", name="tick") / "grouser_tick.h").read_text()
    assert "} grouser_tick_tick_record;" in header
    assert "int grouser_tick_vehicle_tick(" in header


def test_a_policy_that_the_core_cannot_hold_is_refused(rigid: Surrogate, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="remembers 32 samples, entry_window is 33"):
        export_c(rigid, tmp_path / "a", policy=SwitchingPolicy(entry_window=33))


def test_a_folder_with_content_is_refused_and_an_export_replaced_when_asked(rigid: Surrogate, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    export_c(rigid, folder)
    with pytest.raises(InvalidInputError, match=r"not empty.*--force"):
        export_c(rigid, folder)
    (folder / "README.md").write_text("altered")
    export_c(rigid, folder, replace=True)
    assert (folder / "README.md").read_text() != "altered"
    (folder / "mine.c").write_text("")
    with pytest.raises(InvalidInputError, match=r"mine\.c.*would be lost"):
        export_c(rigid, folder, replace=True)
    assert (folder / "mine.c").is_file()
    with pytest.raises(InvalidInputError, match="is a file"):
        export_c(rigid, folder / "mine.c")
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("there", [False, True])
def test_an_interruption_leaves_nothing_half_written(
    rigid: Surrogate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    folder = tmp_path / "out"
    if there:
        export_c(rigid, folder)
    before = {file.name: file.read_bytes() for file in folder.iterdir()} if there else {}
    written: list[Path] = []
    write = Path.write_text

    def interrupted(self: Path, *arguments: Any, **options: Any) -> int:
        if len(written) == 3:
            raise KeyboardInterrupt
        written.append(self)
        return write(self, *arguments, **options)

    monkeypatch.setattr(Path, "write_text", interrupted)
    with pytest.raises(KeyboardInterrupt):
        export_c(rigid, folder, replace=True)
    assert [entry.name for entry in tmp_path.iterdir()] == (["out"] if there else [])
    assert before == ({file.name: file.read_bytes() for file in folder.iterdir()} if there else {})


def test_a_network_that_the_core_cannot_hold_is_refused(rigid: Surrogate, tmp_path: Path) -> None:
    network, width = rigid.network, 600
    wide = DenseNetwork(
        network.activation,
        (np.zeros((FEATURES, width), np.float32), np.zeros((width, 15), np.float32)),
        (np.zeros(width, np.float32), np.zeros(15, np.float32)),
    )
    with pytest.raises(ConfigurationError, match="cannot hold"):
        export_c(replace(rigid, network=wide), tmp_path / "x")


@pytest.mark.parametrize(("teacher", "message"), [("native", "must be 'physics' or 'exact'"), ("mine", "unknown")])
def test_a_teacher_that_is_no_block_is_refused(rigid: Surrogate, tmp_path: Path, teacher: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        export_c(replace(rigid, recipe={"teacher": {"backend": teacher}}), tmp_path / "x")
    assert not list(tmp_path.iterdir())


def test_a_core_without_its_sources_is_named(rigid: Surrogate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from grouser.native.sources import read_source

    def without_guard(place: str) -> str:
        if place == "src/guard.c":
            raise FileNotFoundError(place)
        return read_source(place)

    monkeypatch.setattr("grouser.surrogate.export.c_export.read_source", without_guard)
    with pytest.raises(ConfigurationError, match=r"misses native/src/guard\.c; install grouser again"):
        export_c(rigid, tmp_path / "x")
