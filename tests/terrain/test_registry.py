"""Backends by name: built-in, one's own, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from grouser.terrain import (
    ConfigurationError,
    FloatArray,
    ForceBackend,
    Mode,
    PhysicsBackend,
    TrackedVehicle,
    backend_names,
    interface,
    make_backend,
    register_backend,
)

M113 = TrackedVehicle.preset("m113")


class Constant(ForceBackend):
    """The same push everywhere."""

    name = "test-constant"

    def __init__(self, vehicle: TrackedVehicle, mode: Mode, *, push: float = 1.0) -> None:
        super().__init__(vehicle, mode)
        self.push = push

    def forces(self, x: FloatArray) -> FloatArray:
        x = interface(self.mode).check(x)
        return np.full((*x.shape[:-1], 3), self.push)


register_backend("test-constant", Constant)


def test_the_four_backends_of_the_project_are_registered() -> None:
    assert {"physics", "torch", "native", "guarded"} <= set(backend_names())
    assert list(backend_names()) == sorted(backend_names())


def test_physics_is_made_by_name_with_its_options() -> None:
    backend = make_backend("physics", mode="soil", vehicle="ugv", cells=(2, 1), contact="per_wheel")
    assert isinstance(backend, PhysicsBackend)
    assert (backend.mode, backend.vehicle.name) == ("soil", "ugv")
    assert backend.describe()["cells"] == [2, 1]
    assert backend.describe()["contact"] == "per_wheel"


def test_the_default_vehicle_is_the_m113() -> None:
    assert make_backend("physics", mode="rigid").vehicle == M113


def test_a_vehicle_of_ones_own_is_taken() -> None:
    mine = replace(M113, name="mine", mass=9000.0)
    assert make_backend("physics", mode="rigid", vehicle=mine).vehicle == mine


def test_a_registered_class_is_made_by_name() -> None:
    backend = make_backend("test-constant", mode="rigid", push=5.0)
    np.testing.assert_array_equal(backend.forces(np.zeros((2, 10))), np.full((2, 3), 5.0))
    _, jacobian = backend.forces_and_jacobian(np.zeros((2, 10)))
    np.testing.assert_array_equal(jacobian, np.zeros((2, 3, 10)))
    assert "test-constant" in backend_names()


def test_an_entry_point_is_imported_on_first_use() -> None:
    register_backend("test-by-name", "grouser.terrain.physics:PhysicsBackend")
    assert isinstance(make_backend("test-by-name", mode="rigid"), PhysicsBackend)


def test_a_backend_that_is_built_is_returned_as_it_is() -> None:
    backend = PhysicsBackend(M113, "rigid", cells=(2, 1))
    assert make_backend(backend, mode="rigid", vehicle="m113") is backend


def test_a_backend_that_is_built_has_to_fit() -> None:
    backend = PhysicsBackend(M113, "rigid")
    with pytest.raises(ConfigurationError, match=r"rigid.*soil"):
        make_backend(backend, mode="soil")
    with pytest.raises(ConfigurationError, match=r"m113.*ugv"):
        make_backend(backend, mode="rigid", vehicle="ugv")
    with pytest.raises(ConfigurationError, match="cells"):
        make_backend(backend, mode="rigid", cells=(2, 1))


@pytest.mark.parametrize(
    ("backend", "mode", "vehicle", "nearest"),
    [
        ("phisics", "rigid", "m113", "physics"),
        ("physics", "sol", "m113", "soil"),
        ("physics", "soil", "maxii", "maxxii"),
    ],
)
def test_unknown_names_are_answered_with_the_nearest(backend: str, mode: str, vehicle: str, nearest: str) -> None:
    with pytest.raises(ConfigurationError, match=f"did you mean '{nearest}'"):
        make_backend(backend, mode=mode, vehicle=vehicle)


def test_an_option_of_no_backend_is_refused_with_its_name() -> None:
    with pytest.raises(ConfigurationError, match="cels"):
        make_backend("physics", mode="rigid", cels=(2, 1))


def test_an_error_inside_a_backend_is_not_taken_for_a_wrong_option() -> None:
    def broken(vehicle: TrackedVehicle, mode: Mode) -> ForceBackend:
        return len(None)  # type: ignore[arg-type,return-value]

    register_backend("test-broken", broken)
    with pytest.raises(TypeError, match="NoneType"):
        make_backend("test-broken", mode="rigid")


def test_an_entry_point_without_a_colon_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"package\.module:attribute"):
        register_backend("test-odd", "grouser.terrain.physics")
