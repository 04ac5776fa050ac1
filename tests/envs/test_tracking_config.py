"""Settings and reset options of the path-tracking task."""

import dataclasses
import math
from typing import Any

import pytest

from grouser.envs import PathTrackingEnv, ResetOptions, TrackingConfig
from grouser.envs.task_config import check_options
from grouser.envs.tracking_config import tracking_config
from grouser.terrain import ConfigurationError, InvalidInputError, named


def test_defaults_of_the_design() -> None:
    config = TrackingConfig()
    assert (config.action_mode, config.control_period, config.tick) == ("belts", 0.1, 0.01)
    assert (config.maximum_cross_track, config.time_limit) == (5.0, 40.0)
    assert config.integrator == "implicit"
    assert config.observe_terrain is False


def test_is_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        TrackingConfig().tick = 0.02  # type: ignore[misc]


def test_builds_from_keywords() -> None:
    config = tracking_config({"action_mode": "twist", "control_period": 0.2, "slip_power_weight": 0.0})
    assert config == TrackingConfig(action_mode="twist", control_period=0.2, slip_power_weight=0.0)


@pytest.mark.parametrize(
    ("key", "nearest"),
    [
        ("control_perod", "control_period"),
        ("observe_terain", "observe_terrain"),
        ("weight_progress", "progress_weight"),
    ],
)
def test_an_unknown_setting_names_the_nearest(key: str, nearest: str) -> None:
    with pytest.raises(ConfigurationError, match=f"unknown PathTracking setting '{key}'; did you mean '{nearest}'"):
        tracking_config({key: 1.0})


@pytest.mark.parametrize(("mode", "nearest"), [("belt", "belts"), ("twits", "twist")])
def test_an_unknown_action_mode_names_the_nearest(mode: Any, nearest: str) -> None:
    with pytest.raises(ConfigurationError, match=f"unknown action mode '{mode}'; did you mean '{nearest}'"):
        TrackingConfig(action_mode=mode)


@pytest.mark.parametrize(
    "name",
    ["control_period", "tick", "yaw_rate_scale", "maximum_cross_track", "time_limit", "reference_speed"],
)
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "fast"])
def test_what_must_be_positive(name: str, value: Any) -> None:
    with pytest.raises(InvalidInputError, match=name):
        TrackingConfig(**{name: value})


@pytest.mark.parametrize(
    "name",
    [
        "lateral_spread",
        "heading_spread",
        "lowest_start_speed",
        "progress_weight",
        "cross_track_weight",
        "action_change_weight",
        "slip_power_weight",
    ],
)
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_what_must_not_be_negative(name: str, value: Any) -> None:
    with pytest.raises(InvalidInputError, match=name):
        TrackingConfig(**{name: value})
    assert getattr(tracking_config({name: 0.0}), name) == 0.0


@pytest.mark.parametrize(
    "settings",
    [
        {"control_period": 0.015},
        {"control_period": 0.005},
        {"control_period": 0.1, "tick": 0.03},
        {"control_period": 0.3, "time_limit": 40.0},
        {"time_limit": 0.05},
    ],
)
def test_periods_that_do_not_divide_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(InvalidInputError, match="must divide without remainder"):
        PathTrackingEnv("physics", **settings)


def test_an_unknown_integrator_names_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'implicit'"):
        PathTrackingEnv("physics", integrator="implict")


def test_reset_options_are_passed_on() -> None:
    options = {"arc_length": 1.0, "speed": 2.0, "terrain": "ice"}
    assert check_options(ResetOptions, options) == options | {"terrain": named("ice")}


@pytest.mark.parametrize(
    ("key", "nearest"), [("arclength", "arc_length"), ("heading", "heading_offset"), ("terain", "terrain")]
)
def test_an_unknown_reset_option_names_the_nearest(key: str, nearest: str) -> None:
    with pytest.raises(ConfigurationError, match=f"unknown reset option '{key}'; did you mean '{nearest}'"):
        check_options(ResetOptions, {key: 1.0})


@pytest.mark.parametrize(
    ("name", "value"), [("speed", 1e9), ("lateral_offset", 6.0), ("arc_length", 1e6), ("speed", -19.0)]
)
def test_reset_options_out_of_reach_are_refused(name: str, value: float) -> None:
    env = PathTrackingEnv("physics")
    with pytest.raises(InvalidInputError, match=name):
        env.reset(seed=0, options={name: value})
