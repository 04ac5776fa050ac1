"""Errors of grids and surrogate against the physics on a fine grid."""

import numpy as np
import pytest

from grouser.controllers.bench.accuracy import WORST, accuracies, varied_rows
from grouser.controllers.bench.subjects import Subjects
from grouser.terrain import OUTPUT_NAMES, TrackedVehicle

DRIVES = (("asphalt", 4.0), ("ice", 2.0))


@pytest.fixture(scope="module")
def subjects() -> Subjects:
    return Subjects(TrackedVehicle.preset("m113"))


def test_the_rows_differ_lie_inside_the_distribution_and_are_always_alike(subjects: Subjects) -> None:
    rows = varied_rows(subjects, DRIVES)
    assert len(np.unique(rows, axis=0)) == len(rows) > 100
    assert not subjects.guarded.out_of_distribution(rows).any()
    np.testing.assert_array_equal(rows, varied_rows(subjects, DRIVES))


def test_every_finer_grid_is_nearer_and_the_worst_output_is_named(subjects: Subjects) -> None:
    section = accuracies(subjects, varied_rows(subjects, DRIVES))
    errors = {case: [values[name] for name in OUTPUT_NAMES] for case, values in section.figures.items()}
    assert list(errors) == ["2x1", "4x2", "8x4", "16x4", "32x8", "structured"]
    assert all(section.get(case, WORST) == max(values) for case, values in errors.items())
    worst = [max(errors[grid]) for grid in list(errors)[:-1]]
    assert worst == sorted(worst, reverse=True)
    assert 0 < worst[-1] < 0.1 < max(errors["structured"]) < 5
