"""The recipes of the shipped artifacts."""

import json
from dataclasses import asdict

import pytest

from grouser.surrogate import Surrogate, shipped_names
from grouser.surrogate.offline import PRESETS, preset
from grouser.terrain import ConfigurationError


def test_every_shipped_artifact_has_its_preset() -> None:
    assert set(shipped_names()) == set(PRESETS)


@pytest.mark.parametrize("name", shipped_names())
def test_an_artifact_was_made_by_its_preset(name: str) -> None:
    surrogate, recipe = Surrogate.load(name), PRESETS[name]
    trained = json.loads(json.dumps(asdict(recipe.training)))
    assert {key: surrogate.recipe[key] for key in trained} == trained
    assert (surrogate.vehicle.name, surrogate.mode) == (recipe.data.vehicle, recipe.data.mode)
    assert surrogate.range_name == recipe.data.ranges
    assert surrogate.recipe["teacher"]["backend"] == recipe.data.teacher
    split = surrogate.recipe["split"]
    assert sum(len(split[side]) for side in ("train", "validation", "test")) == recipe.data.runs


def test_artifacts_of_one_vehicle_mode_and_ranges_share_their_data() -> None:
    hashes: dict[str, set[str]] = {}
    for name, recipe in PRESETS.items():
        hashes.setdefault(recipe.dataset_name, set()).add(Surrogate.load(name).dataset_hash)
    assert all(len(found) == 1 for found in hashes.values())


def test_structured_artifacts_are_small_and_exact() -> None:
    for name in ("m113-rigid", "m113-soil", "m113-rigid-paper", "m113-soil-paper"):
        surrogate = Surrogate.load(name)
        assert surrogate.structured
        least = 0.9998 if name.endswith("paper") else 0.9995
        assert min(metrics["r2"] for metrics in surrogate.metrics["test"].values()) >= least
        assert surrogate.metrics["mz_tail_share"] <= 0.02


def test_another_seed_draws_other_runs_and_weights() -> None:
    other = preset("m113-rigid", seed=3)
    assert (other.data.seed, other.training.seed) == (3, 3)
    assert preset("m113-rigid") == PRESETS["m113-rigid"]


def test_an_unknown_preset_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'm113-soil'"):
        preset("m113-sol")
