"""One rollout for every driver."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from grouser.envs import BeltCommand, InterfaceLog, LogRecorder, Simulator, VehicleState, rollout
from grouser.terrain import ForceBackend, InvalidInputError, SimulationDivergedError, TrackedVehicle, named

M113 = TrackedVehicle.preset("m113")
ASPHALT = named("asphalt")


@pytest.fixture
def simulator() -> Simulator:
    return Simulator(M113, "physics", ASPHALT)


def sweep(time: float) -> tuple[float, float]:
    return 2.0 + time, 2.0 - time


class TestControlPeriod:
    @pytest.mark.parametrize(("period", "hold"), [(0.01, 1), (0.05, 5), (0.1, 10), (0.3, 30)])
    def test_a_command_is_held_for_it(self, simulator: Simulator, scripted: Any, period: float, hold: int) -> None:
        driver = scripted(sweep)
        log = rollout(simulator, driver, 0.9, control_period=period)
        assert len(log) == 90
        assert len(driver.asked) == 90 // hold
        expected = np.repeat([sweep(state.time) for state in driver.asked], hold, axis=0)
        np.testing.assert_array_equal(log.commands, expected)
        assert [state.time for state in driver.asked] == pytest.approx(np.arange(0, 90, hold) * 0.01, abs=1e-12)

    def test_is_a_tenth_of_a_second_by_default(self, simulator: Simulator, scripted: Any) -> None:
        driver = scripted(sweep)
        rollout(simulator, driver, 0.5)
        assert len(driver.asked) == 5

    def test_the_driver_sees_the_whole_state_at_each_control_instant(self, simulator: Simulator, scripted: Any) -> None:
        driver = scripted(sweep)
        log = rollout(simulator, driver, 0.5)
        for index, state in enumerate(driver.asked):
            assert state.vx == log.state("vx")[10 * index]
            assert state.ax == log.state("ax")[10 * index]
        assert driver.asked[0] == VehicleState()

    def test_the_last_one_may_be_cut_short(self, simulator: Simulator, scripted: Any) -> None:
        driver = scripted(sweep)
        assert len(rollout(simulator, driver, 0.25)) == 25
        assert len(driver.asked) == 3

    @pytest.mark.parametrize("tick", [0.005, 0.02, 0.04])
    def test_follows_the_tick(self, scripted: Any, tick: float) -> None:
        simulator = Simulator(M113, "physics", ASPHALT, tick=tick)
        driver = scripted(sweep)
        log = rollout(simulator, driver, 0.8, control_period=0.2)
        assert len(log) == round(0.8 / tick)
        assert len(driver.asked) == 4


def test_equals_stepping_by_hand(simulator: Simulator, scripted: Any) -> None:
    log = rollout(simulator, scripted(sweep), 0.5)
    other = Simulator(M113, "physics", ASPHALT)
    recorder = LogRecorder(other)
    for _ in range(5):
        command = BeltCommand(*sweep(other.get_state().time))
        for _ in range(10):
            recorder.append(command, other.step(command))
    again = recorder.finish()
    for name in ("inputs", "forces", "states", "commands", "divisions"):
        np.testing.assert_array_equal(getattr(again, name), getattr(log, name))
    assert other.get_state() == simulator.get_state()


def test_goes_on_from_the_state_that_the_simulator_has(simulator: Simulator, scripted: Any) -> None:
    whole = rollout(Simulator(M113, "physics", ASPHALT), scripted(sweep), 0.6)
    parts = [rollout(simulator, scripted(sweep), 0.3) for _ in range(2)]
    np.testing.assert_array_equal(np.concatenate([part.forces for part in parts]), whole.forces)
    np.testing.assert_array_equal(parts[0].states[-1], parts[1].states[0])


def test_the_driver_is_reset_once_and_first(simulator: Simulator, scripted: Any) -> None:
    driver = scripted(sweep)
    driver.asked.append(VehicleState(time=5.0))
    rollout(simulator, driver, 0.2)
    assert driver.resets == 1
    assert len(driver.asked) == 2


class TestUntil:
    def test_ends_the_drive_at_a_control_instant(self, simulator: Simulator, scripted: Any) -> None:
        asked = []

        def moving(state: VehicleState) -> bool:
            asked.append(state.time)
            return state.vx > 0.5

        driver = scripted(lambda _: (5.0, 5.0))
        log = rollout(simulator, driver, 2.0, until=moving)
        assert len(log) % 10 == 0
        assert 0 < len(log) < 200
        vx = log.state("vx")
        assert vx[-1] > 0.5
        assert (vx[:-1:10] <= 0.5).all()
        assert vx[-1] == simulator.get_state().vx
        assert len(driver.asked) == len(log) // 10
        assert asked == pytest.approx(np.arange(len(log) // 10 + 1) * 0.1)

    def test_that_holds_at_once_gives_an_empty_log(self, simulator: Simulator, scripted: Any) -> None:
        driver = scripted(sweep)
        log = rollout(simulator, driver, 1.0, until=lambda _: True)
        assert isinstance(log, InterfaceLog)
        assert len(log) == 0
        assert log.inputs.shape == (0, 10)
        assert log.forces.shape == (0, 3)
        assert log.states.shape == (1, 11)
        assert (log.fallback_rate, log.switches) == (0.0, 0)
        assert not driver.asked

    def test_that_never_holds_changes_nothing(self, simulator: Simulator, scripted: Any) -> None:
        log = rollout(simulator, scripted(sweep), 0.5, until=lambda _: False)
        other = rollout(Simulator(M113, "physics", ASPHALT), scripted(sweep), 0.5)
        np.testing.assert_array_equal(log.states, other.states)


class TestRefusals:
    @pytest.mark.parametrize("duration", [0.0, -1.0, 0.004, 0.015, 1.0001, math.nan, math.inf])
    def test_a_duration_that_is_no_multiple_of_the_tick(
        self, simulator: Simulator, scripted: Any, duration: float
    ) -> None:
        with pytest.raises(InvalidInputError, match="duration and tick"):
            rollout(simulator, scripted(sweep), duration)
        assert simulator.get_state() == VehicleState()

    @pytest.mark.parametrize("period", [0.0, -0.1, 0.004, 0.015, math.nan, math.inf])
    def test_a_control_period_that_is_no_multiple_of_the_tick(
        self, simulator: Simulator, scripted: Any, period: float
    ) -> None:
        with pytest.raises(InvalidInputError, match="control period and tick"):
            rollout(simulator, scripted(sweep), 1.0, control_period=period)
        assert simulator.get_state() == VehicleState()

    @pytest.mark.parametrize("duration", [0.07, 0.29, 0.3, 0.57, 1.1, 40.0])
    def test_decimal_durations_are_not_refused_for_their_rounding(
        self, simulator: Simulator, scripted: Any, duration: float
    ) -> None:
        rollout(simulator, scripted(sweep), duration, until=lambda _: True)

    @pytest.mark.parametrize("command", [(19.0, 0.0), (0.0, math.nan)])
    def test_a_command_out_of_reach(self, simulator: Simulator, scripted: Any, command: tuple[float, float]) -> None:
        with pytest.raises(InvalidInputError, match="belt command"):
            rollout(simulator, scripted(lambda _: command), 1.0)

    def test_divergence_leaves_the_simulator_at_the_last_good_state(
        self, poisoned: Callable[..., ForceBackend], scripted: Any
    ) -> None:
        backend = poisoned(rate=1.0, below=1.9, jacobian_scale=1.0, output=1, value=math.nan)
        simulator = Simulator(M113, backend, ASPHALT, state=VehicleState(vx=2.0), integrator="euler")
        with pytest.raises(SimulationDivergedError) as caught:
            rollout(simulator, scripted(lambda _: (0.0, 0.0)), 1.0)
        assert caught.value.state == simulator.get_state()
        assert 1.88 < simulator.get_state().vx < 1.9
