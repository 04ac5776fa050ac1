"""Painted fields: patches in order, shapes, noise by its statistics, hills."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grouser.terrain import (
    ConfigurationError,
    Disc,
    FloatArray,
    InvalidInputError,
    Noise,
    Patch,
    Rectangle,
    RigidTerrain,
    Shape,
    SoilTerrain,
    named,
    paint_field,
)

ASPHALT, ICE, GRAVEL = RigidTerrain(0.8, 0.02, 0.01), RigidTerrain(0.1, 0.03, 0.005), RigidTerrain(0.6, 0.05, 0.02)
SOIL = SoilTerrain(2e3, 0.5, 0.1, 0.02)
EXTENT = (-5.0, 5.0, -3.0, 3.0)


def centers(extent: tuple[float, float, float, float], spacing: float) -> tuple[FloatArray, FloatArray]:
    """Where the cells lie, rows along y: counted out with plain ranges."""
    x_min, x_max, y_min, y_max = extent
    columns, rows = round((x_max - x_min) / spacing), round((y_max - y_min) / spacing)
    xs = [x_min + spacing / 2 + i * spacing for i in range(columns)]
    ys = [y_min + spacing / 2 + i * spacing for i in range(rows)]
    return np.array([xs] * rows), np.array([[y] * columns for y in ys])


def grounds(patches: list[Patch], spacing: float = 0.5) -> FloatArray:
    """μ by cell."""
    return paint_field(ASPHALT, EXTENT, spacing=spacing, patches=patches).parameters[..., 0]


# Patches


def test_without_patches_it_is_the_base_everywhere() -> None:
    field = paint_field(SOIL, EXTENT)
    assert field.parameters.shape == (12, 20, 4)
    assert field.extent == EXTENT
    assert field.outside == "refuse"
    assert field.elevation is None
    np.testing.assert_array_equal(field.parameters, np.broadcast_to(SOIL.parameters, (12, 20, 4)))


def test_later_patches_lie_on_top() -> None:
    disc, plate = Disc(0.0, 0.0, 2.0), Rectangle(-1.0, 1.0, -1.0, 1.0)
    x, y = centers(EXTENT, 0.5)
    in_disc, in_plate = x**2 + y**2 <= 4.0, (np.abs(x) < 1) & (np.abs(y) < 1)
    assert in_disc.any()
    assert in_plate.any()
    expected = np.where(in_plate, 0.6, np.where(in_disc, 0.1, 0.8))
    np.testing.assert_array_equal(grounds([Patch(ICE, disc), Patch(GRAVEL, plate)]), expected)
    hidden = np.where(in_disc, 0.1, np.where(in_plate, 0.6, 0.8))
    np.testing.assert_array_equal(grounds([Patch(GRAVEL, plate), Patch(ICE, disc)]), hidden)


def test_a_patch_brings_all_its_parameters() -> None:
    field = paint_field(ASPHALT, EXTENT, patches=[Patch(ICE, Rectangle())])
    np.testing.assert_array_equal(field.parameters, np.broadcast_to(ICE.parameters, (12, 20, 3)))


@pytest.mark.parametrize(
    ("shape", "inside"),
    [
        (Rectangle(x_min=0.0), lambda x, y: x > 0),
        (Rectangle(x_max=0.0), lambda x, y: x < 0),
        (Rectangle(y_min=1.0), lambda x, y: y > 1),
        (Rectangle(y_max=1.0), lambda x, y: y < 1),
        (Rectangle(y_min=-1.0, y_max=1.0), lambda x, y: np.abs(y) < 1),
        (Rectangle(-1.0, 2.0, -3.0, 0.0), lambda x, y: (x > -1) & (x < 2) & (y > -3) & (y < 0)),
        (Disc(1.0, -1.0, 1.5), lambda x, y: np.hypot(x - 1, y + 1) < 1.5),
    ],
    ids=["right half", "left half", "upper half", "lower half", "strip", "rectangle", "disc"],
)
def test_a_shape_covers_what_it_says(shape: Shape, inside: Callable[[FloatArray, FloatArray], Any]) -> None:
    expected = np.where(inside(*centers(EXTENT, 0.5)), 0.1, 0.8)
    assert 0 < np.mean(expected == 0.1) < 1
    np.testing.assert_array_equal(grounds([Patch(ICE, shape)]), expected)


def test_half_planes_that_meet_leave_nothing_between_and_share_nothing() -> None:
    left, right = Rectangle(x_max=0.25), Rectangle(x_min=0.25)
    x = np.array([0.25, np.nextafter(0.25, 0), -1e300, 1e300])
    np.testing.assert_array_equal(left.covers(x, 0 * x), ~right.covers(x, 0 * x))


class Stripes:
    """A shape of one's own."""

    def covers(self, x: FloatArray, y: FloatArray) -> Any:
        return np.floor(x) % 2 == 0


def test_a_shape_of_ones_own_is_painted() -> None:
    x, _ = centers(EXTENT, 0.5)
    np.testing.assert_array_equal(grounds([Patch(ICE, Stripes())]), np.where(np.floor(x) % 2 == 0, 0.1, 0.8))


@pytest.mark.parametrize(("base", "patch"), [(ASPHALT, SOIL), (SOIL, ASPHALT)])
def test_a_patch_of_the_other_mode_is_refused(base: Any, patch: Any) -> None:
    with pytest.raises(ConfigurationError, match=f"got {base.mode} ground with a {patch.mode} patch.*phi = atan"):
        paint_field(base, EXTENT, patches=[Patch(patch, Rectangle())])


@pytest.mark.parametrize(
    "sides", [{"x_min": 1.0, "x_max": 1.0}, {"y_min": 2.0, "y_max": 1.0}, {"x_min": math.nan}, {"x_min": math.inf}]
)
def test_an_empty_rectangle_is_refused(sides: dict[str, float]) -> None:
    with pytest.raises(InvalidInputError, match="x_min < x_max and y_min < y_max"):
        Rectangle(**sides)


@pytest.mark.parametrize("radius", [0.0, -1.0, math.nan, math.inf])
def test_an_empty_disc_is_refused(radius: float) -> None:
    with pytest.raises(InvalidInputError, match="radius"):
        Disc(0.0, 0.0, radius)


@pytest.mark.parametrize("extent", [(0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 1.0, 0.0)])
def test_an_empty_extent_is_refused(extent: tuple[float, float, float, float]) -> None:
    with pytest.raises(InvalidInputError, match="extent"):
        paint_field(ASPHALT, extent)


def test_what_lies_beyond_follows_the_rule() -> None:
    field = paint_field(ASPHALT, EXTENT, patches=[Patch(ICE, Rectangle(x_min=0.0))], outside="extend")
    assert field.parameters_at(1e3, 0.0)[0] == pytest.approx(0.1)
    assert field.parameters_at(-1e3, 0.0)[0] == 0.8


# Noise


def test_the_same_seed_is_the_same_noise_to_the_bit() -> None:
    x, y = centers(EXTENT, 0.5)
    first, second = Noise(2.0, seed=7)(x, y), Noise(2.0, seed=7)(x, y)
    assert first.tobytes() == second.tobytes()
    assert np.abs(Noise(2.0, seed=8)(x, y) - first).max() > 0.1


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_noise_is_a_function_of_the_position_alone(x: float, y: float) -> None:
    noise = Noise(3.0, seed=1)
    grid = np.array([[x, x + 1.0], [x - 5.0, x]]), np.array([[y, y + 2.0], [y, y]])
    alone = noise(np.array([x]), np.array([y]))[0]
    # Round-off of cosines of phases of a hundred radians.
    assert noise(*grid)[0, 0] == pytest.approx(alone, abs=1e-12)
    assert noise(*grid)[1, 1] == pytest.approx(alone, abs=1e-12)


def test_a_finer_grid_samples_the_same_noise() -> None:
    options: dict[str, Any] = {"noise": Noise(2.0, seed=3), "noise_amplitude": {"mu": 0.2, "k": 0.1}}
    coarse = paint_field(ASPHALT, EXTENT, spacing=0.6, **options).parameters
    fine = paint_field(ASPHALT, EXTENT, spacing=0.2, **options).parameters
    # Three fine cells a coarse one: the middle one has the same centre. The map of 10 m ends within a coarse cell.
    np.testing.assert_allclose(coarse[:, :16], fine[1::3, 1::3][:, :16], rtol=1e-12)


SAMPLES, STATIONS = 2000, np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0])
LENGTH = 1.7


@pytest.fixture(scope="module")
def ensemble() -> FloatArray:
    """Noise of many seeds at several distances from a place, in a direction that is no axis, shape (seeds, stations)."""
    x, y = 40.0 + 0.6 * LENGTH * STATIONS, -30.0 + 0.8 * LENGTH * STATIONS
    return np.array([Noise(LENGTH, seed=seed)(x, y) for seed in range(SAMPLES)])


def test_noise_has_mean_zero_and_unit_variance(ensemble: FloatArray) -> None:
    # Four standard errors of a mean and of a variance of normal numbers.
    assert np.abs(ensemble.mean(axis=0)).max() < 4 / math.sqrt(SAMPLES)
    assert np.abs((ensemble**2).mean(axis=0) - 1).max() < 4 * math.sqrt(2 / SAMPLES)


def test_noise_is_correlated_as_a_gaussian_of_the_distance(ensemble: FloatArray) -> None:
    correlation = (ensemble * ensemble[:, :1]).mean(axis=0)
    expected = np.exp(-(STATIONS**2) / 2)  # r = stations * correlation length
    # Four standard errors: a product of unit normal numbers has a variance of 1 + rho^2.
    tolerance = 4 * np.sqrt((1 + expected**2) / SAMPLES)
    np.testing.assert_array_less(np.abs(correlation - expected), tolerance)


def test_noise_has_the_tails_of_a_normal_distribution(ensemble: FloatArray) -> None:
    for limit, share in ((1.0, 0.3173), (2.0, 0.0455)):
        found = np.mean(np.abs(ensemble[:, 0]) > limit)
        assert found == pytest.approx(share, abs=4 * math.sqrt(share / SAMPLES))


def test_noise_multiplies_what_is_named_by_its_exponential() -> None:
    noise = Noise(2.0, seed=5)
    patches = [Patch(ICE, Disc(0.0, 0.0, 2.0))]
    amplitudes = {"mu": 0.2, "k": 0.05}
    plain = paint_field(ASPHALT, EXTENT, patches=patches).parameters
    field = paint_field(ASPHALT, EXTENT, patches=patches, noise=noise, noise_amplitude=amplitudes).parameters
    sample = noise(*centers(EXTENT, 0.5))
    np.testing.assert_allclose(field[..., 0], plain[..., 0] * np.exp(0.2 * sample), rtol=1e-13)
    np.testing.assert_array_equal(field[..., 1], plain[..., 1])
    np.testing.assert_allclose(field[..., 2], plain[..., 2] * np.exp(0.05 * sample), rtol=1e-13)


def test_an_amplitude_of_zero_changes_no_bit() -> None:
    field = paint_field(ASPHALT, EXTENT, noise=Noise(2.0), noise_amplitude={"mu": 0.0})
    np.testing.assert_array_equal(field.parameters, paint_field(ASPHALT, EXTENT).parameters)


def test_noise_that_leads_beyond_what_a_terrain_can_be_is_refused_by_its_cell() -> None:
    rough = RigidTerrain(1.9, 0.02, 0.01)
    with pytest.raises(InvalidInputError, match=r"row \d+, column \d+ of the field: mu must lie in \(0, 2\]"):
        paint_field(rough, EXTENT, noise=Noise(1.0, seed=2), noise_amplitude={"mu": 0.5})


@pytest.mark.parametrize("options", [{"noise": Noise(1.0)}, {"noise_amplitude": {"mu": 0.1}}])
def test_noise_and_its_amplitude_go_together(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError, match="go together"):
        paint_field(ASPHALT, EXTENT, **options)


def test_an_unknown_parameter_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="unknown soil terrain parameter 'ph'; did you mean 'phi'"):
        paint_field(SOIL, EXTENT, noise=Noise(1.0), noise_amplitude={"ph": 0.1})
    with pytest.raises(ConfigurationError, match="unknown rigid terrain parameter 'c'"):
        paint_field(ASPHALT, EXTENT, noise=Noise(1.0), noise_amplitude={"c": 0.1})


@pytest.mark.parametrize("amplitude", [-0.1, 2.1, math.nan, "0.1"])
def test_an_impossible_amplitude_is_refused(amplitude: Any) -> None:
    with pytest.raises(InvalidInputError, match="noise amplitude of mu must lie in"):
        paint_field(ASPHALT, EXTENT, noise=Noise(1.0), noise_amplitude={"mu": amplitude})


@pytest.mark.parametrize("length", [0.0, -1.0, math.nan])
def test_a_correlation_length_is_positive(length: float) -> None:
    with pytest.raises(InvalidInputError, match="correlation_length"):
        Noise(length)


# Hills


def test_hills_are_sampled_at_the_centres() -> None:
    field = paint_field(named("asphalt"), EXTENT, elevation=lambda x, y: 0.1 * x**2 - 0.3 * y)
    x, y = centers(EXTENT, 0.5)
    assert field.elevation is not None
    np.testing.assert_allclose(field.elevation, 0.1 * x**2 - 0.3 * y, rtol=1e-12, atol=1e-15)
    # Away from the edge a B-spline of a parabola has the parabola's own slope.
    assert field.gradient_at(1.2, 0.4) == pytest.approx((0.24, -0.3), rel=1e-12)


def test_a_constant_height_is_level() -> None:
    field = paint_field(named("asphalt"), EXTENT, elevation=lambda x, y: 2.5)
    assert field.elevation_at(0.3, 0.4) == pytest.approx(2.5, rel=1e-15)
    assert field.gradient_at(0.3, 0.4) == pytest.approx((0.0, 0.0), abs=1e-15)


def test_noise_makes_hills() -> None:
    noise = Noise(4.0, seed=2)
    field = paint_field(ICE, EXTENT, spacing=0.25, elevation=lambda x, y: 0.5 * noise(x, y))
    np.testing.assert_array_equal(field.parameters[..., 0], 0.1)
    assert field.elevation is not None
    np.testing.assert_allclose(field.elevation, 0.5 * noise(*centers(EXTENT, 0.25)), rtol=0, atol=1e-13)


def test_a_height_that_is_not_finite_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="finite height"):
        paint_field(ASPHALT, EXTENT, elevation=lambda x, y: np.where(x > 4, np.nan, 0.0))
