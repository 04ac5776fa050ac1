"""The demonstration's sizes, its three drives, and what it makes again; drives and report stand aside here."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import pytest
from policies import make_policy

from grouser.controllers import Drive, PathTrackingMPC, PolicyDriver, demonstration, load_policy
from grouser.controllers.demonstration import demo_scenarios, run_demonstration
from grouser.controllers.demonstration_config import DemoConfig
from grouser.surrogate import Surrogate
from grouser.surrogate.offline import TrainingConfig
from grouser.terrain import ConfigurationError, InvalidInputError, Mode, named

MODES: tuple[Mode, ...] = ("rigid", "soil")


def tiny(folder: FilePath, **changes: Any) -> DemoConfig:
    """As small as it goes while the surrogates still hold a vehicle on the ground, along eight metres."""
    path = folder / "short.csv"
    path.write_text("x,y\n0,0\n2,0\n4,0\n6,0\n8,0\n", encoding="utf-8")
    config = DemoConfig(
        rigid_runs=18,
        soil_runs=18,
        samples_per_run=150,
        training=TrainingConfig(
            epochs=6, batch_size=256, hidden=(32,), learning_rate=1e-2, learning_rate_decay=0.7, perturbed_copies=1
        ),
        path=str(path),
        ice_from=4.0,
    )
    return replace(config, **changes)


@pytest.fixture(autouse=True)
def no_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the drives and the report, which have tests of their own."""

    def compare(*args: Any, **kwargs: Any) -> list[Drive]:
        return []

    def write_report(*args: Any, **kwargs: Any) -> list[FilePath]:
        return []

    monkeypatch.setattr(demonstration, "compare", compare)
    monkeypatch.setattr(demonstration, "write_report", write_report)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Callable[[FilePath], tuple[DemoConfig, FilePath]]:
    """A copy of a finished folder."""
    base = tmp_path_factory.mktemp("demo")
    config = tiny(base)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demonstration, "compare", lambda *args, **kwargs: [])
        patch.setattr(demonstration, "write_report", lambda *args, **kwargs: [])
        run_demonstration(config, base / "done", workers=1)

    def copy(target: FilePath) -> tuple[DemoConfig, FilePath]:
        shutil.copytree(base / "done", target)
        return config, target

    return copy


Finished = Callable[[FilePath], tuple[DemoConfig, FilePath]]


def made_in(folder: FilePath) -> dict[str, tuple[bytes, int]]:
    """Contents and time of writing of data and artifacts."""
    return {
        str(file.relative_to(folder)): (file.read_bytes(), file.stat().st_mtime_ns)
        for kind in ("data", "artifacts")
        for file in sorted((folder / kind).rglob("*"))
        if file.is_file()
    }


def rewritten(before: dict[str, tuple[bytes, int]], after: dict[str, tuple[bytes, int]]) -> set[str]:
    """Names of the artifacts that are not the files of before."""
    return {name for name in after if not name.startswith("data") and before.get(name) != after[name]}


@pytest.mark.parametrize("name", ["rigid_runs", "soil_runs"])
def test_fewer_runs_than_three_of_each_maneuver_are_refused(name: str) -> None:
    with pytest.raises(InvalidInputError, match=rf"{name} must be at least 18.*got 17"):
        DemoConfig(**{name: 17})  # type: ignore[arg-type]
    assert getattr(DemoConfig(**{name: 18}), name) == 18  # type: ignore[arg-type]


@pytest.mark.parametrize("mode", MODES)
def test_data_is_what_the_sizes_say(mode: Mode) -> None:
    config = DemoConfig(rigid_runs=20, soil_runs=30, samples_per_run=40, vehicle="ugv", seed=9)
    data = config.data(mode)
    assert (data.mode, data.vehicle, data.samples_per_run, data.seed) == (mode, "ugv", 40, 9)
    assert (data.runs, data.ranges) == ((20, "paper") if mode == "rigid" else (30, "wide"))


def test_a_first_call_makes_everything_and_leaves_nothing_half_done(finished: Finished, tmp_path: FilePath) -> None:
    config, folder = finished(tmp_path / "demo")
    for mode in MODES:
        surrogate = Surrogate.load(folder / "artifacts" / f"m113-{mode}.safetensors")
        assert surrogate.mode == mode
        assert surrogate.recipe["seed"] == config.seed
    assert sorted(item.name for item in folder.iterdir()) == ["artifacts", "compare.json", "data"]
    assert not [file for file in folder.rglob(".*")]


def test_a_second_call_makes_nothing_again(finished: Finished, tmp_path: FilePath) -> None:
    config, folder = finished(tmp_path / "demo")
    before = made_in(folder)
    said: list[tuple[str, int, int]] = []
    run_demonstration(config, folder, workers=1, progress=lambda *words: said.append(words))
    assert made_in(folder) == before
    stages = {stage for stage, _, _ in said}
    assert {f"surrogate, {mode}" for mode in MODES} <= stages
    for stage in stages:
        *_, (done, total) = [(done, total) for name, done, total in said if name == stage]
        assert done == total


def test_damaged_parts_are_made_again_as_they_were(finished: Finished, tmp_path: FilePath) -> None:
    config, folder = finished(tmp_path / "demo")
    before = made_in(folder)
    name = "artifacts/m113-soil.safetensors"
    (folder / name).write_bytes(before[name][0][:-5])
    run_demonstration(config, folder, workers=1)
    assert {name: data for name, (data, _) in made_in(folder).items()} == {
        name: data for name, (data, _) in before.items()
    }


def test_another_training_makes_the_surrogates_again(finished: Finished, tmp_path: FilePath) -> None:
    config, folder = finished(tmp_path / "demo")
    before = made_in(folder)
    run_demonstration(replace(config, training=replace(config.training, epochs=5)), folder, workers=1)
    assert rewritten(before, made_in(folder)) == {f"artifacts/m113-{mode}.safetensors" for mode in MODES}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"policy": "m113-path-traking"}, "did you mean 'm113-path-tracking'"),
        ({"policy": "m113-parking"}, "trained in grouser/Parking-v0"),
        ({"vehicle": "ugv"}, "m113-path-tracking drives m113, asked for ugv"),
        ({"speed": 3.0}, "drives at 5 m/s, asked for 3"),
    ],
)
def test_a_policy_that_does_not_fit_is_refused_before_anything_is_made(
    tmp_path: FilePath, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigurationError, match=message):
        run_demonstration(tiny(tmp_path, **changes), tmp_path / "demo", workers=1)
    assert not (tmp_path / "demo").exists()


def test_a_policy_that_observes_the_terrain_is_refused_since_it_knows_one_mode(tmp_path: FilePath) -> None:
    file = make_policy(observe_terrain=True, reference_speed=5.0).save(tmp_path / "observant.safetensors")
    with pytest.raises(ConfigurationError, match="observes the terrain"):
        run_demonstration(tiny(tmp_path, policy=str(file)), tmp_path / "demo", workers=1)


def test_the_seed_is_that_of_everything_that_is_drawn(tmp_path: FilePath) -> None:
    config = tiny(tmp_path, seed=3)
    run_demonstration(config, tmp_path / "demo", workers=1)
    for mode in MODES:
        surrogate = Surrogate.load(tmp_path / "demo" / "artifacts" / f"m113-{mode}.safetensors")
        assert surrogate.recipe["seed"] == 3


def test_the_three_drives_are_asphalt_sand_and_asphalt_that_turns_to_ice(
    finished: Finished, tmp_path: FilePath
) -> None:
    config, folder = finished(tmp_path / "demo")
    artifacts = {mode: folder / "artifacts" / f"m113-{mode}.safetensors" for mode in MODES}
    policy = load_policy(config.policy)
    asphalt, sand, onto_ice = demo_scenarios(config, artifacts, policy)
    assert [s.name for s in (asphalt, sand, onto_ice)] == ["asphalt", "lete-sand", "onto-ice"]
    assert asphalt.ground == named("asphalt")
    assert sand.ground == named("lete-sand")
    for x, terrain in ((3.5, "asphalt"), (4.5, "ice")):
        assert onto_ice.ground.parameters_at(x, 0.0).tolist() == named(terrain).parameters.tolist()
    for scenario in (asphalt, sand, onto_ice):
        assert scenario.speed == config.speed
        assert scenario.vehicle.name == "m113"
        assert scenario.path.length == pytest.approx(8.0, abs=1e-6)
        assert set(scenario.backend_options) == {"torch", "native", "guarded"}
        assert {o["artifact"] for o in scenario.backend_options.values()} == {artifacts[scenario.ground.mode]}
        assert isinstance(scenario.drivers["mpc"](), PathTrackingMPC)
        driver = scenario.drivers["policy"]()
        assert isinstance(driver, PolicyDriver)
        assert driver.policy is policy
