"""The terrain field: a quadratic B-spline over cells, its hull, its smoothness, its borders and what it refuses."""

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from grouser.terrain import (
    MODES,
    ConfigurationError,
    FloatArray,
    InvalidInputError,
    Mode,
    RigidTerrain,
    SoilTerrain,
    Terrain,
    TerrainField,
    interface,
    named,
    parameter_ranges,
)

ROWS, COLUMNS, SPACING, ORIGIN = 6, 9, 0.7, (-2.0, 3.0)
X_MAX, Y_MAX = ORIGIN[0] + COLUMNS * SPACING, ORIGIN[1] + ROWS * SPACING
every_mode = pytest.mark.parametrize("mode", MODES)


def varied(mode: Mode = "rigid", seed: int = 0, **changes: Any) -> TerrainField:
    """A field of other parameters in every cell, with hills."""
    rng = np.random.default_rng(seed)
    ranges = parameter_ranges("wide", mode)
    cells = np.array([[ranges.sample(rng).parameters for _ in range(COLUMNS)] for _ in range(ROWS)])
    values: dict[str, Any] = {"parameters": cells, "elevation": rng.normal(0.0, 0.5, (ROWS, COLUMNS))} | changes
    return TerrainField(mode, ORIGIN, SPACING, **values)


FIELDS = {mode: varied(mode) for mode in MODES}
along_x = st.floats(0.0, 1.0).map(lambda share: min(ORIGIN[0] + share * COLUMNS * SPACING, X_MAX))
along_y = st.floats(0.0, 1.0).map(lambda share: min(ORIGIN[1] + share * ROWS * SPACING, Y_MAX))


def spline_weights(position: float, origin: float, count: int) -> FloatArray:
    """Weight of every cell along one axis, the outermost repeated once: scipy's B-spline of degree 2."""
    bump = BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)
    centers = np.arange(-1, count + 1) + 0.5
    weights = np.nan_to_num(bump((position - origin) / SPACING - centers))
    weights[1] += weights[0]
    weights[-2] += weights[-1]
    return np.asarray(weights[1:-1])


def spline(field: TerrainField, values: FloatArray, x: float, y: float) -> FloatArray:
    across, along = spline_weights(y, ORIGIN[1], ROWS), spline_weights(x, ORIGIN[0], COLUMNS)
    return np.asarray(np.einsum("r,c,rc...->...", across, along, values))


# Values


@given(st.sampled_from(MODES), along_x, along_y)
def test_values_are_those_of_a_quadratic_b_spline(mode: Mode, x: float, y: float) -> None:
    field = FIELDS[mode]
    assert field.elevation is not None
    np.testing.assert_allclose(field.parameters_at(x, y), spline(field, field.parameters, x, y), rtol=1e-12)
    assert field.elevation_at(x, y) == pytest.approx(float(spline(field, field.elevation, x, y)), abs=1e-13)


@given(st.sampled_from(MODES), along_x, along_y)
def test_values_lie_within_the_nine_cells_around(mode: Mode, x: float, y: float) -> None:
    field = FIELDS[mode]
    row = min(int((y - ORIGIN[1]) / SPACING), ROWS - 1)
    column = min(int((x - ORIGIN[0]) / SPACING), COLUMNS - 1)
    around = field.parameters[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].reshape(
        -1, field.parameters.shape[2]
    )
    theta = field.parameters_at(x, y)
    rounding = 1e-15 * around.max(axis=0) * 4  # nine products are summed
    assert np.all(theta >= around.min(axis=0) - rounding)
    assert np.all(theta <= around.max(axis=0) + rounding)


@pytest.mark.parametrize("name", ["asphalt", "ice", "lete-sand", "heavy-clay-25"])
@given(along_x, along_y)
@settings(max_examples=30)
def test_uniform_ground_is_returned_to_the_bit(name: str, x: float, y: float) -> None:
    terrain = named(name)
    field = TerrainField.uniform(terrain, (ORIGIN[0], X_MAX, ORIGIN[1], Y_MAX), spacing=0.3)
    assert field.mode == terrain.mode
    assert field.parameters_at(x, y).tobytes() == terrain.parameters.tobytes()
    assert field.elevation_at(x, y) == 0.0
    assert field.gradient_at(x, y) == (0.0, 0.0)


def test_at_the_centre_of_a_cell_its_own_weight_is_nine_sixteenths() -> None:
    cells = np.tile(np.array([0.5, 0.02, 0.02]), (3, 3, 1))
    cells[1, 1, 0] = 0.5 + 0.16
    field = TerrainField("rigid", (0.0, 0.0), 2.0, cells)
    assert field.parameters_at(3.0, 3.0) == pytest.approx([0.5 + 0.09, 0.02, 0.02], rel=1e-14)
    assert field.parameters_at(3.0, 5.0)[0] == pytest.approx(0.5 + 0.16 * 0.75 * 0.125, rel=1e-14)


def test_rows_lie_along_y_and_columns_along_x() -> None:
    cells = np.tile(np.array([0.5, 0.02, 0.02]), (4, 6, 1))
    cells[0, 5, 0] = 1.0
    field = TerrainField("rigid", (10.0, 20.0), 1.0, cells)
    assert field.extent == (10.0, 16.0, 20.0, 24.0)
    assert field.parameters_at(15.9, 20.1)[0] > 0.8
    assert field.parameters_at(10.1, 23.9)[0] == 0.5


@every_mode
@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_linear_change_is_reproduced_away_from_the_map_edge(mode: Mode, axis: str) -> None:
    ranges = parameter_ranges("wide", mode)
    low, high = np.array(ranges.low), np.array(ranges.high)
    x, y = np.meshgrid(ORIGIN[0] + (np.arange(COLUMNS) + 0.5) * SPACING, ORIGIN[1] + (np.arange(ROWS) + 0.5) * SPACING)

    def share(x: Any, y: Any) -> Any:
        return (x - ORIGIN[0]) / 6.3 if axis == "x" else (y - ORIGIN[1]) / 4.2

    field = TerrainField(mode, ORIGIN, SPACING, low + share(x, y)[..., None] * (high - low), elevation=2 * x - 0.5 * y)
    rng = np.random.default_rng(1)
    inner_x, inner_y = rng.uniform(-1.3, 3.5, 50), rng.uniform(3.7, 6.5, 50)  # one cell away from the edge
    for px, py in zip(inner_x, inner_y, strict=True):
        np.testing.assert_allclose(field.parameters_at(px, py), low + share(px, py) * (high - low), rtol=1e-12)
        assert field.elevation_at(px, py) == pytest.approx(2 * px - 0.5 * py, abs=1e-12)
        assert field.gradient_at(px, py) == pytest.approx((2.0, -0.5), abs=1e-12)


def test_a_border_between_two_grounds_is_two_cells_wide() -> None:
    cells = np.tile(named("asphalt").parameters, (3, 10, 1))
    cells[:, 5:] = named("ice").parameters
    field = TerrainField("rigid", (0.0, 0.0), 1.0, cells)
    asphalt, ice = named("asphalt").parameters, named("ice").parameters
    # Each cell's spline reaches one and a half cells either way of its centre: x = 4 to 6 for this edge.
    np.testing.assert_array_equal(field.parameters_at(4.0, 1.5), asphalt)
    np.testing.assert_allclose(field.parameters_at(5.0, 1.5), (asphalt + ice) / 2, rtol=1e-14)
    np.testing.assert_allclose(field.parameters_at(6.0, 1.5), ice, rtol=1e-14)
    values = np.array([field.parameters_at(x, 1.5)[0] for x in np.linspace(4.0, 6.0, 41)])
    assert np.all(np.diff(values) < 0)
    # Ninety-odd percent of the change lie within one and a half cells.
    middle = field.parameters_at(4.25, 1.5)[0] - field.parameters_at(5.75, 1.5)[0]
    assert middle > 0.9 * (asphalt[0] - ice[0])


# Smoothness


def one_sided(evaluate: Any, at: FloatArray, direction: FloatArray, reach: float) -> Any:
    """Derivative at a point by three values on one side of it: exact for a polynomial of degree two."""
    f0, f1, f2 = (evaluate(*(at + factor * reach * direction)) for factor in (0.0, 1.0, 2.0))
    return (-3 * f0 + 4 * f1 - f2) / (2 * reach)


@every_mode
@pytest.mark.parametrize("axis", [0, 1])
def test_the_slope_is_the_same_on_both_sides_of_a_cell_border(mode: Mode, axis: int) -> None:
    field, rng = FIELDS[mode], np.random.default_rng(2)
    direction = np.eye(2)[axis]
    reach = 0.2 * SPACING
    for border in range(1, (COLUMNS, ROWS)[axis]):
        at = np.array([rng.uniform(ORIGIN[0], X_MAX), rng.uniform(ORIGIN[1], Y_MAX)])
        at[axis] = ORIGIN[axis] + border * SPACING
        right = one_sided(field.parameters_at, at, direction, reach)
        left = -one_sided(field.parameters_at, at, -direction, reach)
        scale = np.ptp(field.parameters, axis=(0, 1)) / SPACING
        np.testing.assert_array_less(np.abs(right - left), 1e-12 * scale)
        assert np.max(np.abs(right) / scale) > 1e-3  # there is a slope to compare
        ends = [field.elevation_at(*(at + side * 1e-9 * direction)) for side in (-1, 1)]
        assert ends[0] == pytest.approx(ends[1], abs=1e-8)


@given(along_x, along_y)
def test_the_gradient_is_the_slope_of_the_elevation(x: float, y: float) -> None:
    field = FIELDS["rigid"]
    step = 1e-3 * SPACING
    x = min(max(x, ORIGIN[0] + step), X_MAX - step)
    y = min(max(y, ORIGIN[1] + step), Y_MAX - step)
    by_x = (field.elevation_at(x + step, y) - field.elevation_at(x - step, y)) / (2 * step)
    by_y = (field.elevation_at(x, y + step) - field.elevation_at(x, y - step)) / (2 * step)
    # Exact within a cell; across a border the second derivative jumps by up to 4 m/SPACING^2, which adds a quarter step.
    assert field.gradient_at(x, y) == pytest.approx((by_x, by_y), abs=step * 4 * 2 / SPACING**2)


def test_the_gradient_within_a_cell_is_exact() -> None:
    field, step = FIELDS["soil"], 0.1 * SPACING
    for column in range(COLUMNS):
        x, y = ORIGIN[0] + (column + 0.6) * SPACING, ORIGIN[1] + 2.3 * SPACING
        by_x = (field.elevation_at(x + step, y) - field.elevation_at(x - step, y)) / (2 * step)
        by_y = (field.elevation_at(x, y + step) - field.elevation_at(x, y - step)) / (2 * step)
        assert field.gradient_at(x, y) == pytest.approx((by_x, by_y), abs=1e-12)


# Borders


OUTSIDE_POINTS = [(-2.001, 4.0), (X_MAX + 0.001, 4.0), (0.0, 2.999), (0.0, Y_MAX + 0.001), (-50.0, 90.0)]


@pytest.mark.parametrize(("x", "y"), OUTSIDE_POINTS)
def test_a_position_off_the_map_is_refused_with_its_extent(x: float, y: float) -> None:
    field = varied()
    assert not field.covers(x, y)
    message = (
        rf"\({x:.3f}, {y:.3f}\) m lies off the terrain field's map, x -2 to 4\.3 and y 3 to 7\.2 m.*outside='extend'"
    )
    for call in (field.parameters_at, field.elevation_at, field.gradient_at):
        with pytest.raises(InvalidInputError, match=message):
            call(x, y)


def test_the_border_itself_is_on_the_map() -> None:
    field = varied()
    for x in (ORIGIN[0], field.extent[1]):
        for y in (ORIGIN[1], field.extent[3]):
            assert field.covers(x, y)
            assert field.parameters_at(x, y).shape == (3,)


@every_mode
@pytest.mark.parametrize(("x", "y"), [*OUTSIDE_POINTS, (1e308, -1e308), (1e9, 5.0)])
def test_beyond_the_map_the_nearest_border_goes_on(mode: Mode, x: float, y: float) -> None:
    field = varied(mode, outside="extend")
    x_min, x_max, y_min, y_max = field.extent
    nearest = min(max(x, x_min), x_max), min(max(y, y_min), y_max)
    # The upper borders, origin + count * spacing, are rounded.
    np.testing.assert_allclose(field.parameters_at(x, y), field.parameters_at(*nearest), rtol=1e-14)
    assert field.elevation_at(x, y) == pytest.approx(field.elevation_at(*nearest), abs=1e-14)
    by_x, by_y = field.gradient_at(x, y)
    if not x_min <= x <= x_max:
        assert by_x == 0.0
    if not y_min <= y <= y_max:
        assert by_y == 0.0


def test_on_the_map_the_rule_for_beyond_changes_nothing() -> None:
    refusing, extending = varied(), varied(outside="extend")
    for x, y in ((-1.9, 3.1), (0.0, 5.0), (4.2, 7.1)):
        np.testing.assert_array_equal(refusing.parameters_at(x, y), extending.parameters_at(x, y))
        assert refusing.gradient_at(x, y) == extending.gradient_at(x, y)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("outside", ["refuse", "extend"])
def test_a_position_that_is_not_finite_is_refused(bad: float, outside: Any) -> None:
    hilly, level = varied(outside=outside), varied(outside=outside, elevation=None)
    for x, y in ((bad, 4.0), (0.0, bad)):
        for call in (hilly.parameters_at, hilly.elevation_at, hilly.gradient_at, level.elevation_at):
            with pytest.raises(InvalidInputError, match="must be finite"):
                call(x, y)


def test_a_level_field_refuses_the_slope_where_a_hilly_one_does() -> None:
    """``gradient_at`` raises like ``parameters_at``, with elevation or without."""
    for field in (varied(), varied(elevation=None)):
        for x, y in ((math.nan, 4.0), (-50.0, 4.0)):
            with pytest.raises(InvalidInputError):
                field.gradient_at(x, y)


# What is refused


@pytest.mark.parametrize(
    ("mode", "shape", "columns"),
    [
        ("rigid", (6, 9), "mu, fr, k"),
        ("rigid", (6, 9, 4), "mu, fr, k"),
        ("soil", (6, 9, 3), "c, phi, fr, k"),
        ("soil", (4,), "c, phi, fr, k"),
        ("rigid", (0, 9, 3), "mu, fr, k"),
        ("rigid", (6, 0, 3), "mu, fr, k"),
        ("rigid", (1, 6, 9, 3), "mu, fr, k"),
    ],
)
def test_another_shape_is_refused_with_the_names(mode: Mode, shape: tuple[int, ...], columns: str) -> None:
    with pytest.raises(InvalidInputError, match=rf"{columns}; got shape \({shape[0]},"):
        TerrainField(mode, ORIGIN, SPACING, np.full(shape, 0.5))


@pytest.mark.parametrize(
    ("mode", "name", "value"),
    [
        ("rigid", "mu", 0.0),
        ("rigid", "mu", -0.1),
        ("rigid", "mu", 2.1),
        ("rigid", "mu", math.nan),
        ("rigid", "fr", -1e-9),
        ("rigid", "fr", math.inf),
        ("rigid", "k", 0.0),
        ("soil", "c", -1.0),
        ("soil", "phi", 1.3),
        ("soil", "fr", 1.01),
        ("soil", "k", 1.1),
    ],
)
def test_parameters_that_no_terrain_has_are_refused_by_row_column_and_name(mode: Mode, name: str, value: float) -> None:
    cells = FIELDS[mode].parameters.copy()
    cells[4, 7, interface(mode).parameter_names.index(name)] = value
    with pytest.raises(InvalidInputError, match=rf"row 4, column 7 of the field: {name} must lie in"):
        varied(mode, parameters=cells)


def test_soil_without_strength_is_refused_by_row_and_column() -> None:
    cells = FIELDS["soil"].parameters.copy()
    cells[5, 0, :2] = 0.0
    with pytest.raises(InvalidInputError, match="row 5, column 0 of the field: a soil needs strength"):
        varied("soil", parameters=cells)
    cells[5, 0, 1] = 0.1
    varied("soil", parameters=cells)


@pytest.mark.parametrize("shape", [(6, 8), (9, 6), (6, 9, 1), (54,)])
def test_elevation_of_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInputError, match="finite height for each of 6 x 9 cells, got shape"):
        varied(elevation=np.zeros(shape))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_elevation_that_is_not_finite_is_refused(bad: float) -> None:
    heights = np.zeros((ROWS, COLUMNS))
    heights[2, 3] = bad
    with pytest.raises(InvalidInputError, match="finite height"):
        varied(elevation=heights)


@pytest.mark.parametrize("origin", [(math.nan, 0.0), (0.0, math.inf), (0.0,), (0.0, 0.0, 0.0)])
def test_an_origin_is_a_finite_pair(origin: Any) -> None:
    with pytest.raises(InvalidInputError, match="origin must be a finite pair"):
        TerrainField("rigid", origin, SPACING, FIELDS["rigid"].parameters)


@pytest.mark.parametrize("spacing", [0.0, -1.0, math.nan, math.inf])
def test_a_spacing_is_positive(spacing: float) -> None:
    with pytest.raises(InvalidInputError, match="spacing must lie in"):
        TerrainField("rigid", ORIGIN, spacing, FIELDS["rigid"].parameters)
    with pytest.raises(InvalidInputError, match="spacing must lie in"):
        TerrainField.uniform(named("ice"), (0.0, 1.0, 0.0, 1.0), spacing=spacing)


@pytest.mark.parametrize(
    "extent", [(1.0, 1.0, 0.0, 1.0), (0.0, 1.0, 2.0, 1.0), (0.0, math.inf, 0.0, 1.0), (math.nan, 1.0, 0.0, 1.0)]
)
def test_an_empty_or_endless_extent_is_refused(extent: Any) -> None:
    with pytest.raises(InvalidInputError, match="extent must be"):
        TerrainField.uniform(named("ice"), extent)


def test_more_than_a_hundred_million_cells_are_refused_before_they_are_made() -> None:
    with pytest.raises(InvalidInputError, match="too many: choose a spacing above"):
        TerrainField.uniform(named("ice"), (0.0, 1e5, 0.0, 1e5), spacing=1.0)


def test_unknown_modes_and_rules_are_answered_with_the_nearest() -> None:
    cells = FIELDS["rigid"].parameters
    with pytest.raises(ConfigurationError, match="did you mean 'rigid'"):
        TerrainField("rigit", ORIGIN, SPACING, cells)  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="did you mean 'extend'"):
        TerrainField("rigid", ORIGIN, SPACING, cells, outside="extended")  # type: ignore[arg-type]


# Uniform fields, copies


@pytest.mark.parametrize("terrain", [RigidTerrain(0.6), SoilTerrain(2e3, 0.5)])
def test_a_uniform_field_covers_its_extent(terrain: Terrain) -> None:
    field = TerrainField.uniform(terrain, (-1.0, 2.0, 0.0, 1.05), spacing=0.1)
    assert field.parameters.shape == (11, 30, len(terrain.parameters))
    assert field.extent == pytest.approx((-1.0, 2.0, 0.0, 1.1), abs=1e-12)  # the last row reaches beyond
    exact = TerrainField.uniform(terrain, (0.0, 0.3, 0.0, 0.7), spacing=0.1)
    assert exact.parameters.shape[:2] == (7, 3)


def test_its_arrays_are_its_own_and_frozen() -> None:
    cells, heights = FIELDS["rigid"].parameters.copy(), np.zeros((ROWS, COLUMNS))
    field = varied(parameters=cells, elevation=heights)
    before = field.parameters_at(0.0, 5.0)
    cells[:], heights[:] = 0.9, 7.0
    np.testing.assert_array_equal(field.parameters_at(0.0, 5.0), before)
    assert field.elevation_at(0.0, 5.0) == 0.0
    assert field.elevation is not None
    for array in (field.parameters, field.elevation):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1.0
    with pytest.raises(AttributeError):
        field.spacing = 1.0  # type: ignore[misc]


def test_a_returned_theta_is_a_copy() -> None:
    field = TerrainField.uniform(named("ice"), (0.0, 3.0, 0.0, 3.0))
    field.parameters_at(1.0, 1.0)[:] = 0.0
    np.testing.assert_array_equal(field.parameters_at(1.0, 1.0), named("ice").parameters)


def test_a_copied_field_is_the_same_ground() -> None:
    field = varied(outside="extend")
    for twin in (pickle.loads(pickle.dumps(field)), copy.deepcopy(field)):
        assert (twin.mode, twin.origin, twin.spacing, twin.outside) == ("rigid", ORIGIN, SPACING, "extend")
        np.testing.assert_array_equal(twin.parameters_at(0.3, 4.4), field.parameters_at(0.3, 4.4))
        assert twin.gradient_at(0.3, 4.4) == field.gradient_at(0.3, 4.4)


def test_whole_numbers_are_taken_as_parameters() -> None:
    field = TerrainField("rigid", (0, 0), 1, np.ones((2, 2, 3), dtype=int))
    assert field.parameters.dtype == np.float64
    np.testing.assert_array_equal(field.parameters_at(1, 1), [1.0, 1.0, 1.0])
