"""Driving: once, or the same drive on several backends."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from grouser.envs import STATE_NAMES
from grouser.envs.rollout import rollout
from grouser.terrain import SimulationDivergedError, interface

PURSUIT = ("--controller", "pure-pursuit")


def test_drive_on_physics_keeps_the_path(call: Any, short_path: Path) -> None:
    out = call("drive", "--backend", "physics", *PURSUIT, "--path", short_path).out
    assert "100 % of short (15.0 m)" in out
    assert "cross-track  RMSE 0.0" in out
    assert "guard" not in out
    assert "solves" not in out


def test_drive_by_mpc_says_what_the_solver_did(call: Any, short_path: Path) -> None:
    out = call("drive", "--backend", "physics", "--path", short_path, "--terrain", "lete-sand").out
    assert "0 failed; median" in out


def test_drive_on_iso_says_how_far_out_of_lane(call: Any) -> None:
    out = call("drive", "--backend", "physics", *PURSUIT, "--time-limit", 1).out
    assert "driven       1.00 s, 3 % of iso-3888-1" in out
    assert "out of lane  0.000 m" in out


def test_drive_on_a_guarded_surrogate_says_what_the_guard_did(
    call: Any, artifact: Path, short_path: Path, tmp_path: Path
) -> None:
    file = tmp_path / "new" / "log.npz"
    options = ("--backend", "guarded", "--artifact", artifact, "--path", short_path, "--log", file)
    assert "fallback in" in call("drive", *options, *PURSUIT).out
    with np.load(file, allow_pickle=False) as log:
        ticks = len(log["inputs"])
        assert ticks > 100
        assert list(log["input_names"]) == list(interface("rigid").names)
        assert list(log["state_names"]) == list(STATE_NAMES)
        assert log["states"].shape == (ticks + 1, len(STATE_NAMES))
        assert log["forces"].shape == (ticks, 3)
        assert np.isfinite(log["ood_score"]).all()
        assert json.loads(str(log["meta"]))["backend"]["backend"] == "guarded"


def test_a_shipped_policy_drives_by_its_name(call: Any, short_path: Path) -> None:
    options = ("--backend", "physics", "--path", short_path, "--time-limit", 1)
    assert "driven       1.00 s" in call("drive", "--controller", "m113-path-tracking", *options).out
    unknown = call("drive", "--controller", "m113-path-traking", *options, code=2).err
    assert "did you mean 'm113-path-tracking'" in unknown
    assert "trained in grouser/Parking-v0" in call("drive", "--controller", "m113-parking", *options, code=2).err


def test_drive_is_shown_as_a_still_and_as_a_film(call: Any, short_path: Path, tmp_path: Path) -> None:
    for name, frames in (("last.png", 1), ("all.gif", 9)):
        target = tmp_path / "new" / name
        call("drive", "--backend", "physics", *PURSUIT, "--path", short_path, "--time-limit", 0.8, "--render", target)
        with Image.open(target) as image:
            assert getattr(image, "n_frames", 1) == frames


def test_drive_is_shown_in_a_window(call: Any, short_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    shown = []
    monkeypatch.setattr("grouser.envs.rendering.Renderer._show", lambda renderer: shown.append(renderer))
    options = ("--backend", "physics", *PURSUIT, "--path", short_path, "--time-limit", 0.3)
    call("drive", *options, "--render", "human")
    assert len(shown) == 4


def test_a_drive_that_diverges_is_summed_up_first(
    call: Any, short_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverging(*arguments: Any, **options: Any) -> None:
        error = SimulationDivergedError("no tick was solved")
        error.log = rollout(*arguments, **options)
        raise error

    monkeypatch.setattr("grouser.cli.drive.rollout", diverging)
    options = ("--backend", "physics", *PURSUIT, "--path", short_path, "--log", tmp_path / "log.npz")
    called = call("drive", *options, code=2)
    assert "100 % of short" in called.out
    assert called.err == "error: no tick was solved\n"
    assert (tmp_path / "log.npz").exists()


def test_compare_writes_rows_plots_and_page(call: Any, artifact: Path, short_path: Path, tmp_path: Path) -> None:
    output = tmp_path / "compared"
    out = call(
        "compare", "--path", short_path, "--controller", "mpc,pure-pursuit", "--artifact", artifact, "--seeds", 2,
        "--output", output,
    ).out  # fmt: skip
    compared = json.loads((output / "compare.json").read_text())
    drives = [(row["controller"], row["seed"], row["backend"]) for row in compared["rows"]]
    backends = ("physics", "torch", "native", "guarded")
    assert drives == [(c, s, b) for c in ("mpc", "pure-pursuit") for s in (0, 1) for b in backends]
    assert compared["meta"]["artifacts"].keys() == {"m113 rigid"}
    assert (output / "report.html").exists()
    assert {file.name for file in output.glob("*.png")} == {"asphalt-mpc.png", "asphalt-pure-pursuit.png"}
    assert "R² on unseen runs" in out
    assert "seed" in out


def test_compare_takes_several_grounds_of_physics_alone(call: Any, short_path: Path, tmp_path: Path) -> None:
    call(
        "compare", "--path", short_path, *PURSUIT, "--terrain", "asphalt,lete-sand", "--backends", "physics",
        "--output", tmp_path, "--speed", 4, "--vehicle", "ugv",
    )  # fmt: skip
    rows = json.loads((tmp_path / "compare.json").read_text())["rows"]
    assert [(row["scenario"], row["finished"]) for row in rows] == [("asphalt", True), ("lete-sand", True)]


def test_compare_refuses_a_ground_without_its_surrogate(call: Any, artifact: Path, tmp_path: Path) -> None:
    options = ("--terrain", "lete-sand", "--artifact", artifact, "--output", tmp_path / "none")
    assert "asked for m113 on soil ground" in call("compare", *PURSUIT, *options, code=2).err
    assert not (tmp_path / "none").exists()
