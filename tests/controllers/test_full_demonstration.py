"""The demonstration at its full size, by name: ``make slow``."""

from pathlib import Path

import pytest

from grouser.controllers.demonstration import Demonstration, run_demonstration
from grouser.controllers.demonstration_config import DemoConfig

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Demonstration:
    folder: Path = tmp_path_factory.mktemp("demo")
    return run_demonstration(DemoConfig(), folder, workers=2)


def test_the_mpc_finishes_every_drive_inside_the_corridor_on_every_backend(made: Demonstration) -> None:
    rows = [drive.row for drive in made.drives if drive.row.controller == "mpc"]
    assert len(rows) == 12
    for row in rows:
        assert row.finished, row
        assert row.corridor_violation_m == 0.0, row
        assert row.failed_solves == 0, row


def test_the_policy_finishes_inside_the_corridor_on_asphalt_and_sand_on_every_backend(made: Demonstration) -> None:
    rows = [drive.row for drive in made.drives if drive.row.controller == "policy" and drive.row.scenario != "onto-ice"]
    assert len(rows) == 8
    for row in rows:
        assert row.finished, row
        assert row.corridor_violation_m == 0.0, row


def test_both_surrogates_explain_unseen_runs(made: Demonstration) -> None:
    for name, outputs in made.metrics.items():
        for output, values in outputs.items():
            assert values["r2"] >= 0.94, (name, output)


def test_the_guard_hands_over_on_ice_and_hardly_elsewhere(made: Demonstration) -> None:
    for drive in made.drives:
        row = drive.row
        if row.backend != "guarded":
            assert row.fallback_rate == 0.0
        elif row.scenario == "onto-ice":
            assert row.fallback_rate > 0.5
        else:
            assert row.fallback_rate <= 0.01


def test_on_ice_the_guarded_drive_stays_nearer_to_physics_than_the_unguarded(made: Demonstration) -> None:
    ends = {
        (drive.row.controller, drive.row.backend): drive.row.final_position_difference_m
        for drive in made.drives
        if drive.row.scenario == "onto-ice"
    }
    for controller in ("mpc", "policy"):
        assert ends[controller, "guarded"] < 0.1 * ends[controller, "native"]
