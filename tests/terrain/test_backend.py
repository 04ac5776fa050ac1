"""The abstraction: what a backend of one's own gets for one method written."""

import json
import pickle

import numpy as np
import pytest

from grouser.terrain import (
    ConfigurationError,
    FloatArray,
    ForceBackend,
    PhysicsBackend,
    TrackedVehicle,
    assemble,
    interface,
)

M113 = TrackedVehicle.preset("m113")
GAIN = np.random.default_rng(0).normal(size=(3, 10))


class Quadratic(ForceBackend):
    """Forces whose slope is known."""

    name = "quadratic"

    def forces(self, x: FloatArray) -> FloatArray:
        x = interface(self.mode).check(x)
        return np.asarray((x + x**2) @ GAIN.T)


def test_the_abstraction_is_not_built_by_itself() -> None:
    with pytest.raises(TypeError, match="forces"):
        ForceBackend(M113, "rigid")  # type: ignore[abstract]


def test_a_backend_knows_its_vehicle_and_mode() -> None:
    backend = Quadratic(M113, "rigid")
    assert backend.vehicle == M113
    assert backend.mode == "rigid"


def test_an_unknown_mode_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'rigid'"):
        Quadratic(M113, "rigit")  # type: ignore[arg-type]


def test_the_default_jacobian_is_taken_by_central_differences() -> None:
    x = np.random.default_rng(1).normal(size=(7, 10))
    forces, jacobian = Quadratic(M113, "rigid").forces_and_jacobian(x)
    np.testing.assert_array_equal(forces, Quadratic(M113, "rigid").forces(x))
    assert jacobian.shape == (7, 3, 10)
    # Central differences are exact on a quadratic but for round-off: eps over a step near its cube root.
    np.testing.assert_allclose(jacobian, (1 + 2 * x[:, None, :]) * GAIN, atol=1e-8)


def test_the_default_jacobian_of_one_row_has_no_batch_axis() -> None:
    forces, jacobian = Quadratic(M113, "rigid").forces_and_jacobian(np.zeros(10))
    assert forces.shape == (3,)
    np.testing.assert_allclose(jacobian, GAIN, atol=1e-8)


class SlowPhysics(PhysicsBackend):
    """Physics without its own derivative."""

    forces_and_jacobian = ForceBackend.forces_and_jacobian


def test_the_default_jacobian_of_physics_agrees_with_the_analytic_one() -> None:
    row = np.array([3, 0.2, 0.3, 1, 2, 2.5, 3.8, 0.7, 0.05, 0.05])
    _, analytic = PhysicsBackend(M113, "rigid").forces_and_jacobian(row)
    _, differences = SlowPhysics(M113, "rigid").forces_and_jacobian(row)
    scale = np.abs(analytic).max(axis=1, keepdims=True)
    assert np.max(np.abs(differences - analytic) / scale) < 1e-3  # what the design asks of Jacobians


def test_the_default_jacobian_stays_inside_the_block_where_a_parameter_is_small() -> None:
    row = np.array([3, 0.2, 0.3, 1, 2, 2.5, 3.8, 0.7, 0.0, 1e-6])
    _, jacobian = SlowPhysics(M113, "rigid").forces_and_jacobian(row)
    assert np.all(np.isfinite(jacobian))


def test_track_forces_are_refused_by_a_backend_without_the_capability() -> None:
    x = np.zeros((1, 10))
    assert not Quadratic.has_track_forces
    with pytest.raises(ConfigurationError, match="quadratic"):
        Quadratic(M113, "rigid").track_forces(x, x)


def test_physics_declares_the_capability() -> None:
    assert PhysicsBackend(M113, "rigid").has_track_forces


def test_a_backend_describes_itself_as_json() -> None:
    described = Quadratic(M113, "rigid").describe()
    assert json.loads(json.dumps(described)) == described
    assert described["backend"] == "quadratic"
    assert described["mode"] == "rigid"
    assert described["vehicle"] == "m113"


def test_track_forces_assemble_to_the_sum_over_the_tracks() -> None:
    tracks = np.arange(12.0).reshape(2, 2, 3)
    np.testing.assert_array_equal(assemble(tracks), tracks.sum(axis=1))
    np.testing.assert_array_equal(assemble(tracks[0]), tracks[0].sum(axis=0))


def test_a_backend_of_ones_own_survives_pickling() -> None:
    copy = pickle.loads(pickle.dumps(SlowPhysics(M113, "soil")))
    assert isinstance(copy, SlowPhysics)
    assert copy.mode == "soil"
