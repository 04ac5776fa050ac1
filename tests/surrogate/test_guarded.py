import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from grouser.surrogate import GuardedSurrogate, NativeSurrogate, Surrogate, TorchSurrogate
from grouser.terrain import (
    ConfigurationError,
    FloatArray,
    GuardMode,
    GuardState,
    InvalidInputError,
    PhysicsBackend,
    SwitchingPolicy,
    TrackedVehicle,
    make_backend,
)

Make = Callable[..., Surrogate]
Rows = Callable[..., tuple[Any, Any]]


@pytest.fixture
def mixed(driving_rows: Rows, m113: TrackedVehicle) -> FloatArray:
    """Nominal rows, every third beyond the box, every fifth with its belts against the motion."""
    x: FloatArray = driving_rows(m113, "rigid", runs=3, seed=11)[0]
    x[::3, 7] = 1.5
    x[::5, 5:7] *= -1
    return x


@pytest.fixture
def guarded(make_surrogate: Make, m113: TrackedVehicle) -> GuardedSurrogate:
    return GuardedSurrogate(m113, "rigid", make_surrogate())


def test_flagged_rows_get_the_physics_and_others_the_network(
    guarded: GuardedSurrogate, m113: TrackedVehicle, mixed: FloatArray
) -> None:
    native, physics = NativeSurrogate(m113, "rigid", guarded.surrogate), PhysicsBackend(m113, "rigid")
    outside = guarded.out_of_distribution(mixed)
    assert 0.3 < outside.mean() < 0.7
    forces, jacobian = guarded.forces_and_jacobian(mixed)
    np.testing.assert_array_equal(guarded.forces(mixed), forces)
    for backend, chosen in ((physics, outside), (native, ~outside)):
        expected = backend.forces_and_jacobian(mixed[chosen])
        np.testing.assert_array_equal(forces[chosen], expected[0])
        np.testing.assert_array_equal(jacobian[chosen], expected[1])


def test_single_rows_go_where_they_go_in_a_batch(guarded: GuardedSurrogate, mixed: FloatArray) -> None:
    forces = guarded.forces(mixed[:15])
    for row, expected in zip(mixed[:15], forces, strict=True):
        np.testing.assert_array_equal(guarded.forces(row), expected)


def test_rows_that_are_not_finite_are_refused_but_scored(guarded: GuardedSurrogate, mixed: FloatArray) -> None:
    mixed[4, 0] = np.nan
    assert guarded.ood_score(mixed)[4] == math.inf
    assert guarded.out_of_distribution(mixed)[4]
    with pytest.raises(InvalidInputError, match="vx"):
        guarded.forces(mixed)


def test_the_policy_enters_at_once_outside_the_box(guarded: GuardedSurrogate, mixed: FloatArray) -> None:
    state = guarded.policy.advance(GuardState(), guarded.detector.detect(mixed[0]), 0.01)
    assert (state.mode, state.fallback_weight) == (GuardMode.FALLBACK, 1.0)


def test_options_reach_fallback_and_policy(make_surrogate: Make, mixed: FloatArray, m113: TrackedVehicle) -> None:
    policy = SwitchingPolicy(minimum_dwell=1.0)
    guarded = make_backend(
        "guarded", mode="rigid", artifact=make_surrogate(), primary="torch", policy=policy, cells=(2, 1)
    )
    assert isinstance(guarded, GuardedSurrogate)
    assert isinstance(guarded.primary, TorchSurrogate)
    assert guarded.policy is policy
    np.testing.assert_array_equal(
        guarded.forces(mixed[0]), PhysicsBackend(m113, "rigid", cells=(2, 1)).forces(mixed[0])
    )


def test_the_description_names_artifact_fallback_detector_and_policy(guarded: GuardedSurrogate) -> None:
    description = guarded.describe()
    assert description["primary"]["artifact"] == guarded.surrogate.content_hash
    assert description["fallback"]["cells"] == [16, 4]
    assert description["detector"]["threshold"] == guarded.surrogate.detector.threshold
    assert description["policy"]["blend_samples"] == 4


def test_the_resolution_is_that_of_the_network(guarded: GuardedSurrogate) -> None:
    assert guarded.resolution == np.finfo(np.float32).eps


@pytest.mark.parametrize("primary", ["native", "torch"])
def test_pickling_keeps_the_forces(make_surrogate: Make, m113: TrackedVehicle, mixed: FloatArray, primary: Any) -> None:
    guarded = GuardedSurrogate(m113, "rigid", make_surrogate(), primary)
    again = pickle.loads(pickle.dumps(guarded))
    assert again.describe() == guarded.describe()
    assert again.policy == guarded.policy
    np.testing.assert_array_equal(again.forces(mixed), guarded.forces(mixed))


def test_an_unknown_primary_names_the_nearest(make_surrogate: Make, m113: TrackedVehicle) -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'native'"):
        GuardedSurrogate(m113, "rigid", make_surrogate(), "natve")  # type: ignore[arg-type]


def test_an_unknown_fallback_option_is_refused(make_surrogate: Make) -> None:
    with pytest.raises(ConfigurationError, match="grid"):
        make_backend("guarded", mode="rigid", artifact=make_surrogate(), grid=(2, 1))
