"""Vehicles: geometry that follows from the fields, presets, and what cannot be built."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from grouser.terrain import (
    GRAVITY,
    ConfigurationError,
    InvalidInputError,
    TrackedVehicle,
    resolve_vehicle,
    vehicle_names,
)

M113 = TrackedVehicle.preset("m113")


@pytest.mark.parametrize(
    ("name", "m", "inertia", "length", "tread", "b", "h", "n", "r", "top", "training"),
    [
        ("m113", 11300, 37300, 2.667, 2.159, 0.38, 0.79, 5, 0.245, 18, 10),
        ("marder", 29200, 119000, 3.90, 2.72, 0.48, 0.79, 6, 0.325, 18, 10),
        ("ugv", 4500, 6500, 2.2, 1.7, 0.35, 0.65, 5, 0.20, 12, 6),
        ("maxxii", 61.05, 4.5, 0.70, 0.606, 0.1, 0.25, 5, 0.0856, 1.0, 1),
        ("warthog", 470, 165, 1.164734, 1.08, 0.25, 0.45, 2, 0.30, 5, 5),
    ],
)
def test_presets_hold_the_published_numbers(
    name: str,
    m: float,
    inertia: float,
    length: float,
    tread: float,
    b: float,
    h: float,
    n: int,
    r: float,
    top: float,
    training: float,
) -> None:
    v = TrackedVehicle.preset(name)
    assert (v.name, v.mass, v.yaw_inertia, v.contact_length, v.tread) == (name, m, inertia, length, tread)
    assert (v.track_width, v.cg_height, v.road_wheels, v.sprocket_radius) == (b, h, n, r)
    assert (v.maximum_speed, v.training_speed) == (top, training)


def test_presets_share_belts_and_centred_mass_and_differ_in_soft_speed() -> None:
    for name in vehicle_names():
        v = TrackedVehicle.preset(name)
        assert (v.belt_time_constant, v.belt_acceleration, v.cg_offset) == (0.2, 4.0, 0.0)
        assert v.soft_speed == (0.01 if name == "maxxii" else 0.1)


def test_every_preset_names_its_source_and_the_synthetic_one_says_so() -> None:
    for name in vehicle_names():
        v = TrackedVehicle.preset(name)
        assert v.source not in ("", "user")
        assert v.synthetic == (name == "ugv")


def test_the_sources_of_a_preset_are_its_references_in_order() -> None:
    assert M113.source.startswith("Project Chrono, M113 model: parts summed; Project Chrono, M113 model; assumed ")
    assert M113.source.count("assumed drive") == 1


def test_only_the_wheeled_preset_has_patches_with_gaps() -> None:
    for name in vehicle_names():
        v = TrackedVehicle.preset(name)
        expected = (0.25, "per_wheel") if name == "warthog" else (None, "continuous")
        assert (v.patch_length, v.contact) == expected
    # A patch under each axle, 0.457367 m ahead of the middle and behind it.
    np.testing.assert_allclose(TrackedVehicle.preset("warthog").element_centers, [-0.457367, 0.457367], rtol=1e-12)


def test_rewording_a_source_makes_no_other_vehicle() -> None:
    assert replace(M113, source="as before", synthetic=True) == M113


@pytest.mark.parametrize("name", vehicle_names())
def test_a_hull_covers_its_tracks(name: str) -> None:
    v = TrackedVehicle.preset(name)
    assert (v.hull_length is None) == (v.hull_width is None) == (name in ("maxxii", "ugv"))
    if v.hull_length is not None and v.hull_width is not None:
        assert v.hull_length > v.contact_length
        assert v.hull_width > v.overall_width


def test_a_hull_makes_no_other_vehicle() -> None:
    """Datasets and artifacts are bound to what moves a vehicle, and to the words about it."""
    bare = replace(M113, hull_length=None, hull_width=None)
    assert bare == M113
    assert hash(bare) == hash(M113)
    assert bare.to_dict() == M113.to_dict()
    assert not {"hull_length", "hull_width"} & M113.to_dict().keys()
    assert "AFV Database" not in M113.source
    assert TrackedVehicle.from_dict(M113.to_dict() | {"hull_length": 5.0}).hull_length == 5.0


@pytest.mark.parametrize("name", ["hull_length", "hull_width"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_impossible_hulls_are_refused(name: str, value: Any) -> None:
    with pytest.raises(InvalidInputError, match=name):
        replace(M113, **{name: value})


def test_weight_elements_and_width_follow_from_the_fields() -> None:
    assert GRAVITY == 9.81
    assert M113.weight == 11300 * 9.81
    assert M113.element_length == 2.667 / 5
    assert M113.overall_width == pytest.approx(2.539, rel=1e-15)
    np.testing.assert_allclose(M113.element_centers, 2.667 / 5 * np.arange(-2, 3), atol=1e-15)  # rounding of metres


def test_a_forward_cg_moves_the_contact_centre_backward() -> None:
    v = replace(M113, cg_offset=0.3)
    assert v.contact_center == -0.3
    np.testing.assert_allclose(v.element_centers, M113.element_centers - 0.3, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mass", 0.0),
        ("mass", -1.0),
        ("mass", math.nan),
        ("mass", math.inf),
        ("yaw_inertia", 0.0),
        ("contact_length", 0.0),
        ("tread", -2.0),
        ("tread", 0.38),
        ("track_width", 0.0),
        ("track_width", 2.159),
        ("cg_height", -0.1),
        ("road_wheels", 0),
        ("road_wheels", 2.5),
        ("sprocket_radius", 0.0),
        ("maximum_speed", 0.0),
        ("maximum_speed", 9.0),
        ("training_speed", 18.5),
        ("training_speed", 0.0),
        ("soft_speed", -0.1),
        ("soft_speed", math.nan),
        ("cg_offset", math.inf),
        ("belt_time_constant", -0.1),
        ("belt_acceleration", 0.0),
    ],
)
def test_an_impossible_vehicle_is_refused(name: str, value: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"must|larger|above|exceed"):
        replace(M113, **{name: value})


def test_a_value_that_is_no_number_is_refused_by_name() -> None:
    with pytest.raises(InvalidInputError, match="mass"):
        replace(M113, mass="heavy")  # type: ignore[arg-type]


def test_an_unknown_preset_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'maxxii'"):
        TrackedVehicle.preset("maxii")


def test_a_vehicle_survives_json() -> None:
    v = replace(M113, cg_offset=0.1)
    assert TrackedVehicle.from_dict(json.loads(json.dumps(v.to_dict()))) == v


def test_from_dict_refuses_unknown_missing_and_impossible_values() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'mass'"):
        TrackedVehicle.from_dict({**M113.to_dict(), "mas": 1.0})
    with pytest.raises(InvalidInputError, match="tread"):
        TrackedVehicle.from_dict({key: value for key, value in M113.to_dict().items() if key != "tread"})
    with pytest.raises(InvalidInputError, match="mass"):
        TrackedVehicle.from_dict({**M113.to_dict(), "mass": -1.0})


def test_a_vehicle_is_resolved_from_its_name_or_itself() -> None:
    assert resolve_vehicle("m113") == M113
    assert resolve_vehicle(M113) is M113


@pytest.mark.parametrize(
    "name",
    ["mass", "contact_length", "tread", "track_width", "cg_height", "soft_speed", "cg_offset"],
)
def test_the_block_of_a_vehicle_depends_on_its_geometry_and_mass(name: str) -> None:
    assert not M113.same_block(replace(M113, **{name: getattr(M113, name) + 0.01}))


def test_the_block_of_a_vehicle_does_not_depend_on_its_drive_or_name() -> None:
    other = replace(M113, name="other", yaw_inertia=4e4, sprocket_radius=0.3, belt_time_constant=0.5)
    assert M113.same_block(other)
    assert not M113.same_block(replace(M113, road_wheels=6))
