"""The guard: a pure gate, and a switching policy with memory."""

import math
import pickle
from typing import Any

import numpy as np
import pytest

from grouser.terrain import (
    BlendedForces,
    ConfigurationError,
    Detection,
    FloatArray,
    ForceBackend,
    GuardedBackend,
    GuardMode,
    GuardState,
    InvalidInputError,
    PhysicsBackend,
    SwitchingPolicy,
    TrackedVehicle,
    interface,
)

M113 = TrackedVehicle.preset("m113")
TICK = 0.01
CALM = Detection(0.5, "none", "vx")
UNEASY = Detection(0.9, "none", "vx")  # between the exit level and the threshold
FAR = Detection(1.5, "distance", "vx")
OUTSIDE = Detection(1.2, "box", "mu")
BROKEN = Detection(math.inf, "finite", "vx")


def run(
    *detections: Detection, policy: SwitchingPolicy | None = None, start: GuardState | None = None
) -> list[GuardState]:
    policy, state, states = policy or SwitchingPolicy(), start or GuardState(), []
    for detection in detections:
        state = policy.advance(state, detection, TICK)
        states.append(state)
    return states


def modes(states: list[GuardState]) -> list[GuardMode]:
    return [state.mode for state in states]


P, F = GuardMode.PRIMARY, GuardMode.FALLBACK

# Detection


@pytest.mark.parametrize(
    ("score", "outside"), [(0.0, False), (1.0, False), (1.01, True), (math.inf, True), (math.nan, True)]
)
def test_above_one_or_not_a_number_is_out_of_distribution(score: float, outside: bool) -> None:
    assert Detection(score, "distance", "vx").out_of_distribution is outside


# Entry


def test_a_vehicle_starts_on_the_primary_and_stays_there_in_distribution() -> None:
    states = run(*[UNEASY] * 50)
    assert set(modes(states)) == {P}
    assert {state.fallback_weight for state in states} == {0.0}


@pytest.mark.parametrize("detection", [OUTSIDE, BROKEN, Detection(math.nan, "finite", "vx")])
def test_entry_is_immediate_and_whole_where_the_primary_must_not_look(detection: Detection) -> None:
    (state,) = run(detection)
    assert state.mode is F
    assert state.fallback_weight == 1.0


@pytest.mark.parametrize(
    ("detections", "entered"),
    [
        ((FAR,), False),
        ((FAR, CALM), False),
        ((FAR, FAR), True),
        ((FAR, CALM, FAR), True),
        ((FAR, CALM, CALM, FAR), False),
        ((FAR, CALM, CALM, FAR, CALM, CALM, FAR), False),
    ],
)
def test_entry_on_distance_takes_two_of_the_last_three_samples(
    detections: tuple[Detection, ...], entered: bool
) -> None:
    assert (run(*detections)[-1].mode is F) is entered


def test_after_entry_on_distance_the_output_blends_over_four_samples() -> None:
    weights = [state.fallback_weight for state in run(*[FAR] * 8)]
    assert weights == [0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 1.0, 1.0]


def test_a_row_outside_the_box_cuts_the_blend_short() -> None:
    assert [state.fallback_weight for state in run(FAR, FAR, OUTSIDE, FAR)] == [0.0, 0.25, 1.0, 1.0]


# Exit


def test_exit_takes_three_tenths_of_a_second_of_calm() -> None:
    left = modes(run(OUTSIDE, *[CALM] * 40)).index(P, 1)
    assert left * TICK == pytest.approx(0.3, abs=TICK + 1e-9)  # whether the sample that leaves counts


def test_exit_does_not_happen_between_the_exit_level_and_the_threshold() -> None:
    assert set(modes(run(OUTSIDE, *[UNEASY] * 100))) == {F}


def test_the_exit_level_itself_is_not_calm() -> None:
    assert set(modes(run(OUTSIDE, *[Detection(0.8, "none", "vx")] * 100))) == {F}


@pytest.mark.parametrize("disturbance", [UNEASY, FAR, OUTSIDE])
def test_a_disturbance_starts_the_calm_anew(disturbance: Detection) -> None:
    states = run(OUTSIDE, *[CALM] * 25, disturbance, *[CALM] * 28)
    assert set(modes(states)) == {F}
    assert P in modes(run(*[CALM] * 4, start=states[-1]))


def test_exit_waits_for_the_minimum_dwell() -> None:
    eager = SwitchingPolicy(exit_time=0.0)
    left = modes(run(OUTSIDE, *[CALM] * 40, policy=eager)).index(P, 1)
    assert left * TICK == pytest.approx(0.2, abs=TICK + 1e-9)  # whether the sample that leaves counts


def test_after_exit_the_output_blends_back_over_four_samples() -> None:
    states = run(OUTSIDE, *[CALM] * 50)
    left = modes(states).index(P)
    assert [state.fallback_weight for state in states[left - 1 : left + 6]] == [1.0, 0.75, 0.5, 0.25, 0.0, 0.0, 0.0]


def test_a_row_outside_the_box_during_the_blend_back_goes_to_the_fallback_whole() -> None:
    states = run(OUTSIDE, *[CALM] * 50)
    halfway = states[modes(states).index(P) + 1]
    (state,) = run(OUTSIDE, start=halfway)
    assert (state.mode, state.fallback_weight) == (F, 1.0)


def test_the_times_are_times_and_not_ticks() -> None:
    policy, state, elapsed = SwitchingPolicy(), GuardState(), 0.0
    state = policy.advance(state, OUTSIDE, 0.05)
    while state.mode is F:
        state = policy.advance(state, CALM, 0.05)
        elapsed += 0.05
    assert elapsed == pytest.approx(0.3, abs=0.05 + 1e-9)


def test_one_sample_blends_at_once() -> None:
    assert [s.fallback_weight for s in run(FAR, FAR, policy=SwitchingPolicy(blend_samples=1))] == [0.0, 1.0]


def test_a_policy_without_votes_to_collect_enters_on_the_first() -> None:
    assert run(FAR, policy=SwitchingPolicy(entry_votes=1, entry_window=1))[0].mode is F


def test_advancing_leaves_the_state_it_came_from() -> None:
    start = GuardState()
    run(OUTSIDE, start=start)
    assert start == GuardState()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("entry_votes", 0),
        ("entry_votes", 4),
        ("entry_window", 1),
        ("exit_score", -0.1),
        ("exit_score", 1.1),
        ("exit_score", math.nan),
        ("entry_votes", 1.5),
        ("exit_time", -0.1),
        ("exit_time", math.nan),
        ("minimum_dwell", -0.1),
        ("minimum_dwell", math.nan),
        ("blend_samples", 0),
        ("blend_samples", 1.5),
    ],
)
def test_an_impossible_policy_is_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"entry_|exit_|dwell|blend"):
        SwitchingPolicy(**{name: value})


# Gate


class Constant(ForceBackend):
    """One number in every output."""

    name = "constant"

    def __init__(self, value: float, vehicle: TrackedVehicle = M113, mode: Any = "rigid") -> None:
        super().__init__(vehicle, mode)
        self.value = value

    def forces(self, x: FloatArray) -> FloatArray:
        x = interface(self.mode).check(x)
        return np.full((*x.shape[:-1], 3), self.value)

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        forces = self.forces(x)
        return forces, np.full((*forces.shape, 10), self.value)


class SpeedDetector:
    """Scores a row by its speed: trained up to 5 m/s."""

    def score(self, x: FloatArray) -> FloatArray:
        return np.asarray(np.abs(x[:, 0]) / 5.0)

    def detect(self, row: FloatArray) -> Detection:
        score = float(self.score(row[None])[0])
        return Detection(score, "distance" if score > 1 else "none", "vx")


def speeds(*values: float) -> FloatArray:
    x = np.ones((len(values), 10))
    x[:, 0] = values
    return x


GUARD = GuardedBackend(Constant(1.0), Constant(2.0), SpeedDetector())


def test_each_row_goes_to_the_backend_that_its_score_chooses() -> None:
    x = speeds(1.0, 6.0, 5.0, -7.0)
    np.testing.assert_array_equal(GUARD.out_of_distribution(x), [False, True, False, True])
    np.testing.assert_array_equal(GUARD.forces(x)[:, 0], [1, 2, 1, 2])


def test_forces_and_jacobian_go_the_same_way() -> None:
    forces, jacobian = GUARD.forces_and_jacobian(speeds(1.0, 6.0))
    assert jacobian.shape == (2, 3, 10)
    np.testing.assert_array_equal(forces[:, 0], [1, 2])
    np.testing.assert_array_equal(jacobian[:, 0, 0], [1, 2])


@pytest.mark.parametrize(("speed", "expected"), [(1.0, 1.0), (6.0, 2.0)])
def test_one_row_has_no_batch_axis(speed: float, expected: float) -> None:
    row = speeds(speed)[0]
    forces, jacobian = GUARD.forces_and_jacobian(row)
    np.testing.assert_array_equal(GUARD.forces(row), np.full(3, expected))
    np.testing.assert_array_equal(forces, np.full(3, expected))
    assert jacobian.shape == (3, 10)


def test_the_score_has_one_value_a_row() -> None:
    np.testing.assert_allclose(GUARD.ood_score(speeds(1.0, 6.0)), [0.2, 1.2], rtol=1e-15)
    assert GUARD.ood_score(speeds(1.0)[0]).shape == (1,)


def test_a_score_that_is_not_a_number_is_out_of_distribution() -> None:
    x = speeds(math.nan, 1.0)
    np.testing.assert_array_equal(GUARD.out_of_distribution(x), [True, False])


def test_a_row_that_is_not_finite_is_refused_as_by_every_backend() -> None:
    with pytest.raises(InvalidInputError, match="vx"):
        GUARD.forces(speeds(math.nan))


def test_the_gate_asks_no_backend_for_rows_it_does_not_get() -> None:
    class Untouchable(Constant):
        def forces(self, x: FloatArray) -> FloatArray:
            raise AssertionError

        def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
            raise AssertionError

    guarded = GuardedBackend(Constant(1.0), Untouchable(2.0), SpeedDetector())
    assert guarded.forces(speeds(1.0, 2.0))[0, 0] == 1.0
    other = GuardedBackend(Untouchable(1.0), Constant(2.0), SpeedDetector())
    assert other.forces_and_jacobian(speeds(6.0, 7.0))[0][0, 0] == 2.0
    assert other.blended_forces_and_jacobian(speeds(1.0)[0], 1.0)[0][0] == 2.0


@pytest.mark.parametrize("weight", [0.0, 0.25, 0.5, 1.0])
def test_the_blend_is_linear_in_the_weight_of_the_fallback(weight: float) -> None:
    forces, jacobian = GUARD.blended_forces_and_jacobian(speeds(1.0)[0], weight)
    np.testing.assert_allclose(forces, np.full(3, 1 + weight), rtol=1e-15)
    np.testing.assert_allclose(jacobian, np.full((3, 10), 1 + weight), rtol=1e-15)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("weight", [0.0, 0.5, 1.0])
def test_a_primary_whose_output_is_not_finite_counts_for_nothing(bad: float, weight: float) -> None:
    guarded = GuardedBackend(Constant(bad), Constant(2.0), SpeedDetector())
    forces, jacobian = guarded.blended_forces_and_jacobian(speeds(1.0)[0], weight)
    np.testing.assert_array_equal(forces, np.full(3, 2.0))
    np.testing.assert_array_equal(jacobian, np.full((3, 10), 2.0))


def test_primary_and_fallback_are_of_one_vehicle_and_mode() -> None:
    with pytest.raises(ConfigurationError, match="soil"):
        GuardedBackend(Constant(1.0), Constant(2.0, mode="soil"), SpeedDetector())
    with pytest.raises(ConfigurationError, match="ugv"):
        GuardedBackend(Constant(1.0), Constant(2.0, TrackedVehicle.preset("ugv")), SpeedDetector())


def test_the_guard_describes_its_parts() -> None:
    guarded = GuardedBackend(Constant(1.0), PhysicsBackend(M113, "rigid"), SpeedDetector())
    described = repr(guarded.describe())
    assert guarded.describe()["backend"] == "guarded"
    assert "constant" in described
    assert "physics" in described


def test_a_guard_and_its_memory_survive_pickling() -> None:
    copy = pickle.loads(pickle.dumps(GUARD))
    np.testing.assert_array_equal(copy.forces(speeds(1.0, 6.0)), GUARD.forces(speeds(1.0, 6.0)))
    state = run(FAR, FAR)[-1]
    assert pickle.loads(pickle.dumps(state)) == state


# Primaries that fail


class Failing(Constant):
    """Answers NaN, or refuses, above 3 m/s."""

    def __init__(self, *, refuses: bool) -> None:
        super().__init__(1.0)
        self.refuses = refuses

    def _spoilt(self, x: FloatArray, answer: FloatArray) -> FloatArray:
        fast = np.atleast_2d(x)[:, 0] > 3.0
        if self.refuses and fast.any():
            raise InvalidInputError("too fast")
        rows = answer if x.ndim == 2 else answer[None]
        spoilt = np.where(fast.reshape(-1, *[1] * (rows.ndim - 1)), np.nan, rows)
        return spoilt if x.ndim == 2 else spoilt[0]

    def forces(self, x: FloatArray) -> FloatArray:
        return self._spoilt(x, super().forces(x))

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        forces, jacobian = super().forces_and_jacobian(x)
        return self._spoilt(x, forces), jacobian


@pytest.mark.parametrize("refuses", [False, True])
def test_the_gate_is_never_without_an_answer(refuses: bool) -> None:
    guarded = GuardedBackend(Failing(refuses=refuses), Constant(2.0), SpeedDetector())
    assert guarded.forces(speeds(4.0)[0])[0] == 2.0
    assert guarded.forces_and_jacobian(speeds(4.0)[0])[0][0] == 2.0
    batch = guarded.forces(speeds(1.0, 4.0, 6.0))
    assert np.isfinite(batch).all()
    assert batch[1:, 0].tolist() == [2.0, 2.0]
    assert np.isfinite(guarded.forces_and_jacobian(speeds(1.0, 4.0))[0]).all()


@pytest.mark.parametrize("refuses", [False, True])
@pytest.mark.parametrize("weight", [0.0, 0.5])
def test_a_blend_notes_that_its_primary_failed(refuses: bool, weight: float) -> None:
    blended = BlendedForces(GuardedBackend(Failing(refuses=refuses), Constant(2.0), SpeedDetector()), weight)
    blended(speeds(1.0)[0])
    assert not blended.primary_failed
    assert blended(speeds(4.0)[0])[0][0] == 2.0
    assert blended.primary_failed
