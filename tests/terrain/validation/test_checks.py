"""Every check passes on the real block, and those that should do fail on a wrong one."""

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from grouser.terrain import FloatArray, ForceBackend, InvalidInputError, Mode, ShearGrid, TrackedVehicle
from grouser.terrain.validation import COMPILED, ORACLE, Block, Check, ReferenceBackend, run_checks, shear_cells
from grouser.terrain.validation.agreement_checks import grid_convergence, jacobian, parity, track_split
from grouser.terrain.validation.closed_form_checks import full_slip_moments, golden_state, lateral_saturation, thrust
from grouser.terrain.validation.identity_checks import load_sums, power_identity, symmetries
from grouser.terrain.validation.states import driven_states, random_states
from grouser.terrain.validation.turn_checks import skid_turns, turning_resistances

M113 = TrackedVehicle.preset("m113")
CHECK = Check(1, "a", "b", "c", "N", 10.0, 10.1, 0.05, "absolute", "d")


@pytest.fixture(scope="module")
def checks() -> list[Check]:
    return run_checks(M113, quick=True)


def test_every_check_passes_on_both_implementations(checks: list[Check]) -> None:
    assert [check for check in checks if not check.passed] == []
    assert {check.number for check in checks} == set(range(1, 11))
    assert [check.number for check in checks] == sorted(check.number for check in checks)
    for number in (1, 2, 3, 5, 6, 7, 8, 10):
        assert {check.block for check in checks if check.number == number} >= {"compiled", "NumPy"}
    assert len({(check.number, check.name, check.block, check.quantity) for check in checks}) == len(checks)


def test_progress_counts_to_its_end() -> None:
    told: list[tuple[int, int]] = []
    run_checks(M113, blocks=[], quick=True, progress=lambda done, total: told.append((done, total)))
    assert told == [(1, 1)]


def test_a_vehicle_with_gaps_between_its_patches_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="gaps"):
        run_checks(replace(M113, patch_length=0.2, contact="per_wheel"), quick=True)


@pytest.mark.parametrize(
    ("kind", "measured", "tolerance", "passed"),
    [
        ("absolute", 10.04, 0.05, True),
        ("absolute", 9.94, 0.05, False),
        ("relative", 10.04, 0.005, True),
        ("relative", 10.06, 0.005, False),
        ("at most", 10.04, 0.05, True),
        ("at most", 1.0, 0.0, True),
        ("at most", 10.06, 0.05, False),
        ("absolute", math.nan, 1e9, False),
        ("at most", -math.inf, 1e9, False),
    ],
)
def test_a_check_passes_within_its_tolerance(kind: Any, measured: float, tolerance: float, passed: bool) -> None:
    check = replace(CHECK, kind=kind, measured=measured, tolerance=tolerance)
    assert check.passed is passed
    if math.isfinite(measured):
        assert json.loads(json.dumps(check.to_dict()))["passed"] is passed


class Altered(ForceBackend):
    """The compiled block with its input or its forces changed."""

    has_track_forces = True

    def __init__(self, inner: ForceBackend, change: Callable[[FloatArray], FloatArray], add: FloatArray) -> None:
        super().__init__(inner.vehicle, inner.mode)
        self._inner, self._change, self._add = inner, change, add

    def forces(self, x: FloatArray) -> FloatArray:
        return np.asarray(self._inner.forces(self._change(x)) + self._add)

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        _, slopes = self._inner.forces_and_jacobian(self._change(x))
        return self.forces(x), slopes

    def track_forces(self, x_left: FloatArray, x_right: FloatArray) -> FloatArray:
        return self._inner.track_forces(self._change(x_left), self._change(x_right))


def altered(scale: dict[int, float] | None = None, add: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Block:
    """A block whose input columns are scaled, or to whose forces something is added."""

    def change(x: FloatArray) -> FloatArray:
        changed = np.array(x, dtype=float)
        for column, factor in (scale or {}).items():
            changed[..., column] *= factor
        return changed

    def build(vehicle: TrackedVehicle, mode: Mode, grid: ShearGrid, soft_speed: float) -> ForceBackend:
        return Altered(COMPILED.build(vehicle, mode, grid, soft_speed), change, np.array(add))

    return Block("altered", build)


def failing(checks: Iterator[Check]) -> int:
    return sum(not check.passed for check in checks)


def test_friction_that_is_a_hundredth_too_large_fails_whatever_weighs_it() -> None:
    wrong = altered({7: 1.01})
    assert failing(golden_state(wrong)) == 6
    assert failing(full_slip_moments(wrong, M113)) == 8
    assert failing(lateral_saturation(wrong, M113)) >= 2
    assert failing(thrust(wrong, M113)) >= 4
    assert failing(power_identity(wrong, M113, 20)) == 1
    assert failing(load_sums(wrong, M113, 20)) == 1
    assert failing(parity(wrong, M113, 20)) == 1
    assert failing(symmetries(wrong, M113, 20)) == 0  # it is as symmetric as before


def test_a_yaw_moment_from_nowhere_breaks_symmetry_and_split() -> None:
    wrong = altered(add=(0.0, 0.0, 1e-3))
    assert failing(symmetries(wrong, M113, 20)) == 2  # mirror and fore-aft; scaling does not see it
    assert failing(track_split(wrong, M113, 20)) == 1


def test_a_wrong_slope_fails() -> None:
    assert failing(jacobian(altered({2: 1.01}), ORACLE, M113, 50)) == 2
    assert failing(jacobian(COMPILED, ORACLE, M113, 50)) == 0


def test_a_wrong_yaw_rate_fails_in_turns() -> None:
    wrong = altered({2: 1.05})
    assert failing(turning_resistances(wrong, (5.0, 20.0))) >= 1
    assert failing(skid_turns(wrong, along=200)) == 8


def test_a_grid_that_does_not_converge_fails() -> None:
    def build(vehicle: TrackedVehicle, mode: Mode, grid: ShearGrid, soft_speed: float) -> ForceBackend:
        coarse = replace(grid, along=2, across=1) if grid.along < 80 else grid
        return COMPILED.build(vehicle, mode, coarse, soft_speed)

    assert failing(grid_convergence(Block("coarse", build), M113, 40)) == 3


def test_the_oracle_as_a_backend_splits_its_forces() -> None:
    x = random_states(M113, "soil", 20)
    grid = ShearGrid(4, 2, "per_wheel", "exact")
    oracle = ReferenceBackend(M113, "soil", grid, 0.1)
    compiled = COMPILED.build(M113, "soil", grid, 0.1)
    np.testing.assert_allclose(oracle.track_forces(x, x), compiled.track_forces(x, x), rtol=0, atol=1e-6)


@pytest.mark.parametrize("path", ["soft", "exact"])
def test_cells_add_up_to_the_block(path: Any) -> None:
    x = random_states(M113, "rigid", 50)
    x[:, 8] = 0.0
    grid = ShearGrid(5, 3, "continuous", path)
    cells = shear_cells(M113, "rigid", x, grid=grid, soft_speed=0.1)
    moment = np.sum(cells.x * cells.force_y - cells.y * cells.force_x, axis=1)
    sums = np.column_stack([cells.force_x.sum(axis=1), cells.force_y.sum(axis=1), moment])
    np.testing.assert_allclose(sums, COMPILED.build(M113, "rigid", grid, 0.1).forces(x), rtol=0, atol=1e-6)


def test_states_are_the_same_for_the_same_seed_and_stay_in_their_bounds() -> None:
    for draw in (random_states, driven_states):
        x = draw(M113, "rigid", 30, seed=4)
        np.testing.assert_array_equal(x, draw(M113, "rigid", 30, seed=4))
        assert not np.array_equal(x, draw(M113, "rigid", 30, seed=5))
        assert np.abs(x[:, 5:7]).min() >= 0.05 * M113.training_speed * (1 - 1e-12)
    driven = driven_states(M113, "soil", 60)
    assert np.median(np.abs(driven[:, 4])) < 3.0
    assert np.all(driven[:, 0] > 0)
