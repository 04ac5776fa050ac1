"""A policy at the wheel of a bare simulator: what its environment would have done, to the bit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from grounds import stepped
from policies import make_policy

from grouser.controllers import Policy, PolicyDriver
from grouser.envs import BeltCommand, Path, PathTrackingEnv, Simulator, TickRecord, rollout
from grouser.envs.paths import make_path, straight
from grouser.terrain import ConfigurationError, Ground, TrackedVehicle, named

M113 = TrackedVehicle.preset("m113")
ASPHALT, ICE, SAND = named("asphalt"), named("ice"), named("lete-sand")


# An episode that starts in the middle of a path, off it, and one that starts where a path crosses itself.
EPISODES: dict[str, tuple[Callable[[], Path], Ground, dict[str, Any], dict[str, float]]] = {
    "belts": (lambda: make_path("iso-3888-1", M113), ASPHALT, {}, {"lateral_offset": 0.15, "heading_offset": 0.04}),
    "twist": (
        lambda: make_path("iso-3888-1", M113),
        SAND,
        {"action_mode": "twist", "reference_speed": 4.0},
        {"lateral_offset": -0.1},
    ),
    "sees the terrain change": (
        lambda: straight(60.0),
        stepped(ASPHALT, ICE, 6.0),
        {"action_mode": "twist", "observe_terrain": True},
        {"lateral_offset": 0.2},
    ),
    "slow control, sdirk2": (
        lambda: make_path("sine", M113),
        ASPHALT,
        {"control_period": 0.2, "tick": 0.02, "integrator": "sdirk2", "yaw_rate_scale": 0.5},
        {"arc_length": 31.7, "lateral_offset": 0.1},
    ),
    "closed path, from before its start": (
        lambda: make_path("circle", M113),
        ASPHALT,
        {"action_mode": "twist"},
        {"lateral_offset": 0.1, "heading_offset": 0.05, "arc_length": -0.02},
    ),
    "from a crossing": (
        lambda: make_path("figure-eight", M113),
        ASPHALT,
        {"action_mode": "twist"},
        {"lateral_offset": 0.1},
    ),
}


@pytest.mark.parametrize("name", EPISODES)
def test_a_driver_drives_a_bare_simulator_as_the_environment_does(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    make, ground, settings, options = EPISODES[name]
    path, limit = make(), 4.0
    named_ground = "lete-sand" if ground.mode == "soil" else "asphalt"
    policy = make_policy(seed=2, drive=0.4, terrain=named_ground, time_limit=limit, **settings)
    driver = PolicyDriver(policy, path, ground)
    # Tick by tick, to be watched.
    env = PathTrackingEnv("physics", M113, ground, path, time_limit=limit, engine="python", **settings)
    assert env.config == driver.config
    commands: list[BeltCommand] = []
    records: list[TickRecord] = []
    step = env.simulator.step

    def watched(command: BeltCommand) -> TickRecord:
        commands.append(command)
        records.append(step(command))
        return records[-1]

    monkeypatch.setattr(env.simulator, "step", watched)
    observation, _ = env.reset(seed=5, options=dict(options))
    start = env.simulator.get_state()
    done = False
    while not done:
        observation, _, terminated, truncated, _ = env.step(policy.act(observation))
        done = terminated or truncated
    assert len(records) > 50

    config = driver.config
    simulator = Simulator(M113, "physics", ground, tick=config.tick, integrator=config.integrator, state=start)
    log = rollout(simulator, driver, len(records) * config.tick, control_period=config.control_period)
    assert np.array_equal(log.commands, np.array(commands))
    assert len(np.unique(log.commands, axis=0)) > 5
    assert np.array_equal(log.forces, np.array([record.forces for record in records]))
    for field, column in (("x", "x"), ("y", "y"), ("heading", "heading"), ("yaw_rate", "yaw_rate")):
        assert np.array_equal(log.state(column)[1:], [getattr(record.state, field) for record in records])
    assert simulator.get_state() == env.simulator.get_state()


def test_a_driver_sees_its_own_clipped_action_as_the_previous_one(monkeypatch: pytest.MonkeyPatch) -> None:
    policy = make_policy(seed=2, drive=5.0)
    seen: list[list[float]] = []
    act = Policy.act

    def watched(self: Policy, observation: Any) -> Any:
        seen.append(observation[17:19].tolist())
        return act(self, observation)

    monkeypatch.setattr(Policy, "act", watched)
    rollout(Simulator(M113, "physics", ASPHALT), PolicyDriver(policy, straight(20.0), ASPHALT), 0.3)
    assert seen == [[0.0, 0.0], [1.0, 1.0], [1.0, 1.0]]


def test_a_driver_forgets_the_last_drive() -> None:
    policy = make_policy(seed=2, drive=0.4)
    driver = PolicyDriver(policy, make_path("sine", M113), ASPHALT)
    logs = [rollout(Simulator(M113, "physics", ASPHALT), driver, 2.0) for _ in range(2)]
    assert np.array_equal(logs[0].states, logs[1].states)
    assert np.array_equal(logs[0].commands, logs[1].commands)


def test_a_policy_of_another_task_does_not_drive_along_a_path() -> None:
    policy = make_policy()
    facts = dict(policy.environment) | {"id": "grouser/SpeedTracking-v0"}
    other = Policy(policy.architecture, policy.weights, policy.observation_space, policy.action_space, facts)
    with pytest.raises(ConfigurationError, match="trained in grouser/SpeedTracking-v0"):
        PolicyDriver(other, straight(), ASPHALT)


def test_a_policy_that_observes_the_terrain_drives_on_ground_of_its_mode_only() -> None:
    policy = make_policy(observe_terrain=True)
    PolicyDriver(policy, straight(), ICE)
    with pytest.raises(ConfigurationError, match="another mode than soil"):
        PolicyDriver(policy, straight(), SAND)
