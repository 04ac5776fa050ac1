"""The demonstration in small: the drives are cut short here, everything else is what ``--quick`` does."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from grouser.cli.demo import full_config, quick_config
from grouser.controllers import without_times
from grouser.controllers.demonstration_config import DemoConfig

#: What design.md promises of a row.
ROW = {
    "scenario", "terrain", "controller", "backend", "seed", "cross_track_rmse_m", "final_position_difference_m",
    "final_heading_difference_rad", "force_r2", "first_move_difference_rms", "fallback_rate", "force_call_ns",
    "deadline_misses",
}  # fmt: skip
MADE = (
    "data/rigid/dataset.json", "data/soil/dataset.json", "artifacts/m113-rigid.safetensors",
    "artifacts/m113-soil.safetensors",
)  # fmt: skip


def _demo(call: Any, folder: Path) -> str:
    # Whole drives are those of the full demonstration.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("grouser.cli.demo.quick_config", lambda seed: replace(quick_config(seed), time_limit=1.0))
        return str(call("demo", "--quick", "--workers", 1, "--output", folder).out)


@pytest.fixture(scope="module")
def first(call: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("demo") / "first"
    return folder, _demo(call, folder)


def _compared(folder: Path) -> dict[str, Any]:
    compared: dict[str, Any] = json.loads((folder / "compare.json").read_text())
    return compared


def test_rows_hold_what_was_promised(first: tuple[Path, str]) -> None:
    compared = _compared(first[0])
    assert set(compared) == {"meta", "rows"}
    drives = [(row["scenario"], row["controller"], row["backend"]) for row in compared["rows"]]
    assert len(set(drives)) == len(drives) == 3 * 2 * 4
    for row in compared["rows"]:
        assert set(row) >= ROW
        assert len(row["force_r2"]) == 3
        if row["backend"] == "physics":
            assert row["first_move_difference_rms"] == row["final_position_difference_m"] == 0.0


def test_table_and_files(first: tuple[Path, str]) -> None:
    folder, out = first
    for expected in ("onto-ice", "policy", "guarded", "m113 rigid", "m113 soil", "R² on unseen runs"):
        assert expected in out
    assert str(folder / "report.html") in out
    plots = {file.name for file in folder.glob("*.png")}
    assert plots == {f"{s}-{c}.png" for s in ("asphalt", "lete-sand", "onto-ice") for c in ("mpc", "policy")}


def test_report_needs_no_other_file(first: tuple[Path, str]) -> None:
    page = (first[0] / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 6
    for outside in ("http:", "https:", "<link", "<script", "@import", "url("):
        assert outside not in page


def test_called_again_in_place_and_elsewhere_it_gives_the_same(
    call: Any, first: tuple[Path, str], tmp_path: Path
) -> None:
    folder, _ = first
    before, compared = {name: (folder / name).stat().st_mtime_ns for name in MADE}, _compared(folder)
    _demo(call, folder)
    assert {name: (folder / name).stat().st_mtime_ns for name in MADE} == before
    assert without_times(_compared(folder)) == without_times(compared)
    _demo(call, tmp_path / "second")
    assert without_times(_compared(tmp_path / "second")) == without_times(compared)


def test_one_seed_for_everything() -> None:
    config = full_config(5)
    assert (config.seed, config.training.seed) == (5, 5)
    assert full_config(0) == DemoConfig()
