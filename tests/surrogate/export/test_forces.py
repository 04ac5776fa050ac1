"""The exported functions against the NumPy oracles and the backends."""

import math

import numpy as np
from exported import Exported

from grouser.surrogate import NativeSurrogate, Surrogate
from grouser.terrain import FloatArray, PhysicsBackend


def test_the_self_test_passes(code: Exported) -> None:
    assert code.call("self_test") == 0


def test_the_version_and_the_artifact_are_named(code: Exported, surrogate: Surrogate) -> None:
    version = code.call("abi_version")
    assert code.function("abi_matches")(version) == 1
    assert code.function("abi_matches")(version + 1) == 0
    assert code.text("artifact_hash", 65) == surrogate.content_hash


def test_surrogate_forces_are_those_of_the_oracle(code: Exported, surrogate: Surrogate, rows: FloatArray) -> None:
    expected = surrogate.reference_forces(rows)
    error = abs(code.forces("surrogate", rows) - expected) / expected.std(axis=0)
    assert error.max() < 1e-5


def test_fallback_forces_are_those_of_the_physics(code: Exported, surrogate: Surrogate, rows: FloatArray) -> None:
    expected = PhysicsBackend(surrogate.vehicle, surrogate.mode).forces(rows)
    error = abs(code.forces("fallback", rows) - expected) / expected.std(axis=0)
    assert error.max() < 1e-9


def test_jacobians_are_those_of_the_backends(code: Exported, surrogate: Surrogate, rows: FloatArray) -> None:
    vehicle, mode = surrogate.vehicle, surrogate.mode
    for source, backend, share in (
        ("surrogate", NativeSurrogate(vehicle, mode, surrogate), 1e-5),
        ("fallback", PhysicsBackend(vehicle, mode), 1e-9),
    ):
        expected = backend.forces_and_jacobian(rows)[1]
        scale = abs(expected).max(axis=0)
        assert (abs(code.jacobian(source, rows) - expected) <= share * scale).all()


def test_forces_do_not_depend_on_whether_a_jacobian_is_asked_for(code: Exported, rows: FloatArray) -> None:
    for source in ("surrogate", "fallback"):
        alone = code.forces(source, rows[:20])
        with_jacobian = np.array([code._evaluate(source, row, np.empty((3, code.columns)))[0] for row in rows[:20]])
        np.testing.assert_array_equal(alone, with_jacobian)


def test_scores_are_those_of_the_detector(code: Exported, surrogate: Surrogate, rows: FloatArray) -> None:
    rows[::4, :7] *= 2.0
    for row in rows:
        expected, got = surrogate.detector.detect(row), code.score(row)
        assert math.isclose(got.score, expected.score, rel_tol=1e-9)
        assert ("none", "finite", "box", "distance")[got.reason] == expected.reason


def test_rows_that_cannot_be_taken_are_refused_and_named(code: Exported, rows: FloatArray) -> None:
    row = rows[0].copy()
    assert code.refuses(row) == -1
    for column, value in ((2, math.nan), (6, math.inf), (code.columns - 1, 0.0)):
        bad = row.copy()
        bad[column] = value
        assert code.refuses(bad) == column
    assert code.score(np.full(code.columns, math.nan)).score == math.inf
