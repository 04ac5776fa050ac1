"""Track forces with their derivatives: what each track contributes, on ground of its own."""

from collections.abc import Callable

import numpy as np
import pytest

from grouser.terrain import (
    MODES,
    ConfigurationError,
    ExactBackend,
    FloatArray,
    ForceBackend,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    TrackedVehicle,
    assemble,
    interface,
    parameter_ranges,
)

M113 = TrackedVehicle.preset("m113")
KINDS: dict[str, type[PhysicsBackend]] = {"physics": PhysicsBackend, "exact": ExactBackend}

States = Callable[..., FloatArray]
every_mode = pytest.mark.parametrize("mode", MODES)
every_kind = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS.keys())


class SlowPhysics(PhysicsBackend):
    """Physics without its own derivatives."""

    track_forces_and_jacobian = ForceBackend.track_forces_and_jacobian


class SlowExact(ExactBackend):
    """The exact path without its own derivatives."""

    track_forces_and_jacobian = ForceBackend.track_forces_and_jacobian


class Whole(ForceBackend):
    """Does not know the tracks apart."""

    name = "whole"

    def forces(self, x: FloatArray) -> FloatArray:
        return np.zeros((*self.interface.check(x).shape[:-1], 3))


def smooth_states(mode: Mode, count: int) -> tuple[FloatArray, FloatArray]:
    """Rows without clipped loads, standing belts or vanishing slip, on different ground under each track."""
    rng = np.random.default_rng(11)
    ranges = parameter_ranges("wide", mode)
    left = np.zeros((count, interface(mode).size))
    left[:, 0] = rng.uniform(2.0, 6.0, count)
    left[:, 1] = rng.normal(0.0, 0.3, count)
    left[:, 2] = rng.uniform(-0.5, 0.5, count)
    left[:, 3:5] = rng.normal(0.0, 1.0, (count, 2))
    for column, y in ((5, M113.tread / 2), (6, -M113.tread / 2)):
        # Half a metre a second of slip, either way, is more than a track's width brings: ω b/2 < 0.1 m/s.
        left[:, column] = left[:, 0] - left[:, 2] * y + rng.choice([-1, 1], count) * rng.uniform(0.5, 1.0, count)
    right = left.copy()
    for x in (left, right):
        x[:, 7:] = [ranges.sample(rng).parameters for _ in range(count)]
    return left, right


@every_kind
@every_mode
def test_both_tracks_sum_to_the_vehicle(kind: type[PhysicsBackend], mode: Mode, states: States) -> None:
    x = states(M113, mode, 60)
    block = kind(M113, mode, cells=(4, 2))
    forces, jacobian = block.forces_and_jacobian(x)
    tracks, slopes = block.track_forces_and_jacobian(x, x)
    assert tracks.shape == (60, 2, 3)
    assert slopes.shape == (60, 2, 3, interface(mode).size)
    np.testing.assert_array_equal(assemble(tracks), forces)
    np.testing.assert_array_equal(slopes.sum(axis=1), jacobian)


@every_kind
@every_mode
def test_they_come_with_the_forces_of_the_tracks(kind: type[PhysicsBackend], mode: Mode) -> None:
    left, right = smooth_states(mode, 40)
    block = kind(M113, mode, cells=(4, 2))
    tracks, _ = block.track_forces_and_jacobian(left, right)
    # Round-off: the sums with derivatives need not be taken in the same order.
    np.testing.assert_allclose(tracks, block.track_forces(left, right), rtol=0, atol=1e-12 * M113.weight)


@every_kind
@every_mode
def test_each_slope_is_that_of_its_track_by_its_own_input(kind: type[PhysicsBackend], mode: Mode) -> None:
    left, right = smooth_states(mode, 60)
    block = kind(M113, mode, cells=(4, 2))
    _, jacobian = block.track_forces_and_jacobian(left, right)
    for column, name in enumerate(interface(mode).names):
        step = np.zeros(left.shape[1])
        step[column] = 1e-4 * np.abs(left[:, column]).max()

        def slope(factor: float, step: FloatArray = step, column: int = column) -> FloatArray:
            ahead = block.track_forces(left + factor * step, right + factor * step)
            behind = block.track_forces(left - factor * step, right - factor * step)
            return np.asarray((ahead - behind) / (2 * factor * step[column]))

        expected = (4 * slope(0.5) - slope(1.0)) / 3  # truncation of fourth order
        scale = np.abs(jacobian[..., column]).max()
        assert np.abs(jacobian[..., column] - expected).max() < 1e-6 * scale, name


@every_kind
def test_a_track_does_not_feel_the_others_belt_or_ground(kind: type[PhysicsBackend]) -> None:
    left, right = smooth_states("rigid", 20)
    block = kind(M113, "rigid", cells=(4, 2))
    tracks, jacobian = block.track_forces_and_jacobian(left, right)
    np.testing.assert_array_equal(jacobian[:, 0, :, 6], 0.0)
    np.testing.assert_array_equal(jacobian[:, 1, :, 5], 0.0)
    assert np.all(np.abs(jacobian[:, 0, 0, 5]) > 0)
    alone, alone_jacobian = block.track_forces_and_jacobian(left, left)
    np.testing.assert_array_equal(tracks[:, 0], alone[:, 0])
    np.testing.assert_array_equal(jacobian[:, 0], alone_jacobian[:, 0])
    assert np.all(np.any(tracks[:, 1] != alone[:, 1], axis=-1))


@pytest.mark.parametrize(("slow", "fast"), [(SlowPhysics, PhysicsBackend), (SlowExact, ExactBackend)])
@every_mode
def test_the_default_takes_central_differences(
    slow: type[PhysicsBackend], fast: type[PhysicsBackend], mode: Mode
) -> None:
    left, right = smooth_states(mode, 30)
    tracks, jacobian = slow(M113, mode, cells=(4, 2)).track_forces_and_jacobian(left, right)
    expected_tracks, expected = fast(M113, mode, cells=(4, 2)).track_forces_and_jacobian(left, right)
    assert tracks.shape == (30, 2, 3)
    assert jacobian.shape == expected.shape
    np.testing.assert_allclose(tracks, expected_tracks, rtol=0, atol=1e-12 * M113.weight)
    scale = np.abs(expected).max(axis=(0, 1, 2))
    assert np.max(np.abs(jacobian - expected) / scale) < 1e-3  # what the design asks of Jacobians


@every_kind
def test_one_row_counts_as_one(kind: type[PhysicsBackend]) -> None:
    left, right = smooth_states("rigid", 1)
    block = kind(M113, "rigid")
    by_row, by_batch = block.track_forces_and_jacobian(left[0], right[0]), block.track_forces_and_jacobian(left, right)
    assert by_row[1].shape == (1, 2, 3, 10)
    for actual, expected in zip(by_row, by_batch, strict=True):
        np.testing.assert_array_equal(actual, expected)


def test_no_rows_give_no_slopes() -> None:
    nothing = np.empty((0, 10))
    tracks, jacobian = PhysicsBackend(M113, "rigid").track_forces_and_jacobian(nothing, nothing)
    assert (tracks.shape, jacobian.shape) == ((0, 2, 3), (0, 2, 3, 10))


def test_it_asks_for_as_many_rows_on_either_side_and_for_numbers() -> None:
    left, right = smooth_states("rigid", 4)
    for block in (PhysicsBackend(M113, "rigid"), SlowPhysics(M113, "rigid")):
        with pytest.raises(InvalidInputError, match="rows"):
            block.track_forces_and_jacobian(left, right[:3])
        with pytest.raises(InvalidInputError, match="shape"):
            block.track_forces_and_jacobian(left[:, :9], right)
        bad = right.copy()
        bad[2, 4] = np.nan
        with pytest.raises(InvalidInputError, match=r"\bay\b"):
            block.track_forces_and_jacobian(left, bad)


def test_a_shear_modulus_that_is_not_positive_is_refused_with_its_row() -> None:
    left, right = smooth_states("rigid", 4)
    right[2, 9] = 0.0
    with pytest.raises(InvalidInputError, match=r"row 2.*\bk\b"):
        PhysicsBackend(M113, "rigid").track_forces_and_jacobian(left, right)


def test_a_backend_that_does_not_know_the_tracks_apart_says_so() -> None:
    x = np.ones((2, 10))
    with pytest.raises(ConfigurationError, match="'whole' backend gives the force of the whole vehicle"):
        Whole(M113, "rigid").track_forces_and_jacobian(x, x)
