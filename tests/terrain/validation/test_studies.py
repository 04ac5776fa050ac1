"""Studies: what they must show, that they repeat, and that the report holds them."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grouser.terrain import InvalidInputError, TrackedVehicle, named, terrain_names
from grouser.terrain.validation import STUDIES, Check, Validation, page, write_validation
from grouser.terrain.validation.report import rounded

M113 = TrackedVehicle.preset("m113")
CHECK = Check(3, "a | b", "compiled", "Mz", "N m", 10.0, 10.0, 0.01, "relative", "c")
NAMES = [study.name for study in STUDIES]


@pytest.fixture(scope="module")
def data() -> dict[str, dict[str, Any]]:
    return {study.name: rounded(study.compute(M113, True)) for study in STUDIES}


def test_data_repeat_and_fit_into_json(data: dict[str, dict[str, Any]]) -> None:
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    quick = [study for study in STUDIES if study.name not in ("grid-convergence", "turning-radius")]
    assert all(rounded(study.compute(M113, True)) == data[study.name] for study in quick)


def test_thrust_follows_the_closed_form(data: dict[str, dict[str, Any]]) -> None:
    for curve in data["thrust-slip"]["curves"]:
        assert np.abs(curve["error_default"]).max() < 2e-3
        assert np.abs(curve["error_fine"]).max() < 1e-4


def test_drawbar_pull_rises_from_rolling_resistance_on_every_soil(data: dict[str, dict[str, Any]]) -> None:
    curves = {curve["name"]: curve for curve in data["drawbar-pull"]["curves"]}
    assert set(curves) == {name for name in terrain_names() if named(name).mode == "soil"}
    for name, curve in curves.items():
        assert curve["pull"][0] == pytest.approx(-named(name).parameters[2], rel=1e-5)
        assert np.all(np.diff(curve["pull"]) > 0)
    assert curves["north-gower-clayey-loam"]["kind"] == "loam"


def test_the_exact_continuous_model_turns_as_the_empirical_curve(data: dict[str, dict[str, Any]]) -> None:
    curves = data["turning-resistance"]["curves"]
    exact = [np.abs(curve["deviation_percent"]).max() for curve in curves if curve["name"].startswith("exact")]
    assert len(exact) == 2
    assert max(exact) < 6
    for curve in curves:
        assert np.all(np.array(curve["by_lateral_force"]) < np.array(curve["by_thrust"]))
        assert np.all(np.diff(curve["by_thrust"]) < 0)


def test_friction_bounds_the_force_of_a_track(data: dict[str, dict[str, Any]]) -> None:
    study = data["friction-ellipse"]
    for curve in study["by_size"]:
        radius = np.hypot(*curve["force"])
        assert np.ptp(radius) < 1e-4
    sizes = [np.hypot(*curve["force"]).max() for curve in (*study["by_size"], *study["by_angle"])]
    assert max(sizes) <= 1 + 1e-5


def test_the_tightest_turn_respects_friction_and_the_inner_belt(data: dict[str, dict[str, Any]]) -> None:
    study = data["turning-radius"]
    speed = np.array(study["speed"])
    assert {curve["name"] for curve in study["curves"]} == set(terrain_names())
    for curve in study["curves"]:
        free, forward = (np.array(curve["radius_m"][key], dtype=float) for key in ("any", "forward"))
        held = np.isfinite(free)
        assert np.all(free[held] >= 0.98 * np.maximum(1.0, (speed**2 / (9.81 * curve["friction"]))[held]))
        assert np.all(forward[held] >= 0.999 * free[held])


def test_soft_and_exact_paths_agree_on_straight_runs_only(data: dict[str, dict[str, Any]]) -> None:
    study = data["soft-exact"]
    assert study["largest_on_straight_runs"] < 1e-12
    assert max(np.abs(maps["qy"]).max() for maps in study["difference"].values()) > 0.1


def test_the_report_holds_table_figures_and_data(data: dict[str, dict[str, Any]], tmp_path: Path) -> None:
    validation, folder = Validation("m113", (CHECK,), data), tmp_path / "new"
    told: list[tuple[str, int, int]] = []
    files = write_validation(folder, validation, {"command": "grouser validate"}, lambda *step: told.append(step))
    assert {file.name for file in files} == {"index.md", "validation.json", *(f"{name}.png" for name in NAMES)}
    assert all((folder / f"{name}.png").read_bytes().startswith(b"\x89PNG") for name in NAMES)
    assert told[-1] == ("figures", len(STUDIES), len(STUDIES))
    document = json.loads((folder / "validation.json").read_text(encoding="utf-8"))
    assert document["studies"] == data
    assert document["checks"] == [CHECK.to_dict()]
    text = (folder / "index.md").read_text(encoding="utf-8")
    assert "grouser validate" in text
    assert "a \\| b" in text
    assert "All are within tolerance" in text
    assert all(f"({name}.png)" in text for name in NAMES)


def test_the_page_says_which_checks_fail(data: dict[str, dict[str, Any]]) -> None:
    failing = replace(CHECK, measured=11.0)
    validation = Validation("m113", (CHECK, failing), data)
    assert validation.failed == (failing,)
    text = page(validation, "grouser validate")
    assert "**1 not within tolerance.**" in text
    assert text.count("| **no** |") == 1


def test_numbers_are_rounded_and_must_be_finite() -> None:
    assert rounded({"a": [1.23456789, 2, "x", None], "b": (1e-12,)}) == {"a": [1.23457, 2, "x", None], "b": [1e-12]}
    with pytest.raises(ValueError, match="finite"):
        rounded([float("nan")])


def test_studies_refuse_a_vehicle_with_gaps() -> None:
    with pytest.raises(InvalidInputError, match="gaps"):
        STUDIES[0].compute(replace(M113, patch_length=0.2, contact="per_wheel"), True)
