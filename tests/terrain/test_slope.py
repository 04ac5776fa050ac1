"""Gravity on a slope, and the rule that answers for a slope by the block on level ground."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grouser.native import Physics
from grouser.terrain import (
    CONTACTS,
    LEVEL,
    MODES,
    SHEAR_PATHS,
    Contact,
    ExactBackend,
    FloatArray,
    Gravity,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    ShearPath,
    SlopedGround,
    TerrainField,
    TrackedVehicle,
    body_gravity,
    interface,
    level_equivalent,
    named,
    on_slope,
    paint_field,
    resolve_ground,
)

M113 = TrackedVehicle.preset("m113")
G = 9.81
States = Callable[..., FloatArray]
every_mode = pytest.mark.parametrize("mode", MODES)

slopes = st.floats(-1.0, 1.0)
headings = st.floats(-10.0, 10.0)


# Gravity


@given(slopes, slopes, headings)
def test_gravity_only_turns(p: float, q: float, heading: float) -> None:
    gravity = body_gravity((p, q), heading)
    assert math.hypot(*gravity) == pytest.approx(G, rel=1e-14)
    assert gravity.z > 0
    assert gravity.load_ratio == pytest.approx(1 / math.sqrt(1 + p * p + q * q), rel=1e-14)


@given(slopes, slopes, headings)
def test_gravity_pulls_downhill_in_the_plane(p: float, q: float, heading: float) -> None:
    gravity = body_gravity((p, q), heading)
    # Back in the plane's axes: against the gradient, by g sin of the angle whose tangent it is.
    pull = complex(gravity.x, gravity.y) * np.exp(1j * heading)
    steepest = math.hypot(p, q)
    expected = -G * math.sin(math.atan(steepest)) / (steepest or 1.0) * complex(p, q)
    assert pull == pytest.approx(expected, abs=1e-13)


@given(slopes, slopes, headings, headings)
def test_a_turn_of_the_body_is_a_turn_of_the_pull(p: float, q: float, heading: float, turn: float) -> None:
    before, after = body_gravity((p, q), heading), body_gravity((p, q), heading + turn)
    assert complex(after.x, after.y) == pytest.approx(complex(before.x, before.y) * np.exp(-1j * turn), abs=1e-12)
    assert after.z == before.z


@pytest.mark.parametrize("degrees", [1.0, 10.0, 30.0, 44.0])
@pytest.mark.parametrize(
    ("heading", "along", "aside"), [(0.0, -1.0, 0.0), (90.0, 0.0, 1.0), (180.0, 1.0, 0.0), (-90.0, 0.0, -1.0)]
)
def test_on_one_slope(degrees: float, heading: float, along: float, aside: float) -> None:
    """Facing uphill it is pulled back; with the hill on its right, which is where +x lies at 90°, to the left."""
    gamma = math.radians(degrees)
    gravity = body_gravity((math.tan(gamma), 0.0), math.radians(heading))
    assert gravity == pytest.approx(
        (along * G * math.sin(gamma), aside * G * math.sin(gamma), G * math.cos(gamma)), abs=1e-14
    )


def test_on_level_ground_it_is_the_constant() -> None:
    assert tuple(LEVEL) == (0.0, 0.0, 9.81)
    assert body_gravity((0.0, 0.0), 1.234) is LEVEL
    assert LEVEL.load_ratio == 1.0


# Sloped ground


def test_a_plane_has_the_tangents_of_its_angles_everywhere() -> None:
    ground = SlopedGround(named("asphalt"), grade=0.2, bank=-0.1)
    for x, y in ((0.0, 0.0), (100.0, -30.0)):
        assert ground.gradient_at(x, y) == (math.tan(0.2), math.tan(-0.1))
        np.testing.assert_array_equal(ground.parameters_at(x, y), named("asphalt").parameters)
    assert ground.mode == "rigid"


def test_slopes_add_to_the_grounds_own() -> None:
    hills = paint_field(named("lete-sand"), (0.0, 10.0, 0.0, 10.0), elevation=lambda x, y: 0.3 * x + 0.01 * y**2)
    ground = SlopedGround(SlopedGround(hills, grade=0.1), grade=0.2, bank=0.05)
    by_x, by_y = ground.gradient_at(5.0, 5.0)
    assert (by_x, by_y) == pytest.approx((0.3 + math.tan(0.1) + math.tan(0.2), 0.1 + math.tan(0.05)), rel=1e-12)
    assert ground.mode == "soil"
    with pytest.raises(InvalidInputError, match="off the terrain field's map"):
        ground.gradient_at(11.0, 5.0)


@pytest.mark.parametrize("name", ["grade", "bank"])
@pytest.mark.parametrize("value", [0.8, -0.8, math.nan, math.inf, "0.1"])
def test_a_slope_lies_within_a_right_angles_half(name: str, value: Any) -> None:
    with pytest.raises(InvalidInputError, match=f"{name} must lie in"):
        SlopedGround(named("asphalt"), **{name: value})


def test_a_ground_needs_a_slope_too() -> None:
    class Flat:
        mode = "rigid"

        def parameters_at(self, x: float, y: float) -> FloatArray:
            return named("ice").parameters

    with pytest.raises(InvalidInputError, match="without gradient_at"):
        resolve_ground(Flat())  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="without mode"):
        resolve_ground(3.0)  # type: ignore[arg-type]
    for ground in (named("ice"), SlopedGround(named("ice")), TerrainField.uniform(named("ice"), (0.0, 1.0, 0.0, 1.0))):
        assert resolve_ground(ground) is ground


# The rule, against the block that is built for less gravity


def light_block(mode: Mode, gravity: float, contact: Contact, path: ShearPath) -> Physics:
    """The compiled block of the M113 with CG offset under another gravity."""
    return Physics(
        mode=MODES.index(mode),
        contact=CONTACTS.index(contact),
        path=SHEAR_PATHS.index(path),
        precision=0,
        wheels=5,
        along=4,
        across=2,
        mass=11300.0,
        gravity=gravity,
        contact_length=2.667,
        element_length=2.667 / 5,
        element_spacing=2.667 / 5,
        tread=2.159,
        track_width=0.38,
        cg_height=0.79,
        contact_center=0.0,
        soft_speed=0.1,
    )


KINDS: dict[ShearPath, type[PhysicsBackend]] = {"soft": PhysicsBackend, "exact": ExactBackend}


@every_mode
@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("path", SHEAR_PATHS)
@pytest.mark.parametrize("degrees", [1.0, 20.0, 44.0])
def test_the_rule_is_the_block_under_less_gravity(
    mode: Mode, contact: Contact, path: ShearPath, degrees: float, states: States
) -> None:
    ratio = math.cos(math.radians(degrees))
    x = states(M113, mode, 200, seed=4)
    lifted = 11300 * np.abs(x[:, 4]) * 0.79 / 2.159 > M113.weight * ratio / 2
    assert lifted.sum() > 10  # a side off the ground
    if mode == "soil":
        x[::2, 7] *= 3.0  # cohesion
    block = KINDS[path](M113, mode, cells=(4, 2), contact=contact)
    evaluate = on_slope(block.interface, block.forces_and_jacobian, ratio)
    forces, jacobian = np.empty((200, 3)), np.empty((200, 3, x.shape[1]))
    light_block(mode, G * ratio, contact, path).forces_and_jacobian(x, forces, jacobian)
    scale = np.abs(forces).max(axis=0)
    slope_scale = np.abs(jacobian).max(axis=0)
    for row, expected, slopes in zip(x, forces, jacobian, strict=True):
        answer, derivative = evaluate(row)
        assert np.max(np.abs(answer - expected) / scale) < 1e-12
        # The derivatives hold quotients of differences of the forces' terms.
        assert np.max(np.abs(derivative - slopes) / (slope_scale + 1e-9 * slope_scale.max())) < 1e-11


@every_mode
def test_the_rule_takes_batches(mode: Mode, states: States) -> None:
    x = states(M113, mode, 20)
    block = PhysicsBackend(M113, mode)
    evaluate = on_slope(block.interface, block.forces_and_jacobian, 0.9)
    forces, jacobian = evaluate(x)
    for row, expected, slopes in zip(x, forces, jacobian, strict=True):
        np.testing.assert_array_equal(evaluate(row)[0], expected)
        np.testing.assert_array_equal(evaluate(row)[1], slopes)


@every_mode
def test_the_equivalent_row_changes_what_knows_the_weight_and_nothing_else(mode: Mode, states: States) -> None:
    row = states(M113, mode, 1)[0]
    before = row.copy()
    level = level_equivalent(interface(mode), row, 0.8)
    np.testing.assert_array_equal(row, before)
    changed = {"ax", "ay"} | ({"c"} if mode == "soil" else set())
    for name, old, new in zip(interface(mode).names, row, level, strict=True):
        assert new == pytest.approx(old / 0.8 if name in changed else old, rel=1e-15)


def test_on_level_ground_the_rule_is_nothing() -> None:
    block = PhysicsBackend(M113, "soil")
    row = np.arange(11.0)
    assert level_equivalent(block.interface, row, LEVEL.load_ratio) is row
    evaluate = block.forces_and_jacobian
    assert on_slope(block.interface, evaluate, 1.0) is evaluate


def test_cohesion_does_not_know_the_weight() -> None:
    """Locked and sliding sideways: c A + W g_z/g tan phi, the cohesion whole on any slope."""
    block = PhysicsBackend(M113, "soil")
    row = np.array([0.0, 10.0, 0, 0, 0, 0, 0, 5e3, 0.3, 0.0, 0.005])
    for ratio in (1.0, 0.8):
        side = on_slope(block.interface, block.forces_and_jacobian, ratio)(row)[0][1]
        holding = 5e3 * 2 * 2.667 * 0.38 + ratio * M113.weight * math.tan(0.3)
        assert side == pytest.approx(-holding, rel=1e-9)


def test_gravity_is_made_of_three_numbers() -> None:
    assert Gravity(-1.0, 2.0, 4.905).load_ratio == 0.5
