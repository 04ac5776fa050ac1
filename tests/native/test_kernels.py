"""The compiled kernels beyond single rows: blocks of vehicles, bound arrays, float32 physics, every vector level."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from compiled_kernel import BLOCK, Slopes, block_forces, body_forces

from grouser.native import Mlp, cpu_level
from grouser.surrogate import NativeSurrogate, Surrogate
from grouser.terrain import (
    MODES,
    CompiledBackend,
    FloatArray,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    TrackedVehicle,
    interface,
    make_backend,
    mirror_forces,
    parameter_ranges,
)

M113 = TrackedVehicle.preset("m113")
LEVELS = ("portable", "x86-64-v3", "x86-64-v4")
PLAIN = {"rigid": "m113-rigid-paper-recipe", "soil": "m113-soil-paper-recipe"}

Rows = Callable[[Mode, int], FloatArray]


def rows(mode: Mode, count: int, seed: int = 0) -> FloatArray:
    """States of a drive, some at rest, on ground of the paper's ranges."""
    generator = np.random.default_rng(seed)
    ranges = parameter_ranges("paper", mode)
    theta = ranges.at(generator.uniform(size=(count, len(ranges.low))))
    vx, vy, yaw_rate = generator.normal((3.0, 0.0, 0.0), (2.0, 0.3, 0.4), (count, 3)).T
    belts = vx[:, None] + generator.normal(0.0, 0.4, (count, 2)) + np.outer(yaw_rate, (-1.08, 1.08))
    accelerations = generator.normal(0.0, 1.5, (count, 2))
    x = np.column_stack([vx, vy, yaw_rate, accelerations, belts, theta])
    x[::9, [0, 1, 2, 5, 6]] = 0.0
    return x


def compiled(name: str, mode: Mode) -> CompiledBackend:
    if name == "plain":
        return NativeSurrogate(M113, mode, PLAIN[mode])
    if name == "structured":
        return NativeSurrogate(M113, mode)
    return PhysicsBackend(M113, mode, cells=(4, 2), precision="float32" if name == "single" else "float64")


every_backend = pytest.mark.parametrize("name", ["plain", "structured", "physics", "single"])
every_network = pytest.mark.parametrize("name", ["plain", "structured"])
every_mode = pytest.mark.parametrize("mode", MODES)


# --- blocks of vehicles


@every_mode
@every_network
def test_a_block_returns_the_forces_of_its_rows_to_the_bit(name: str, mode: Mode) -> None:
    backend, x = compiled(name, mode), rows(mode, BLOCK)
    with_slopes, _ = block_forces(backend.kernel, x, x)
    without, _ = block_forces(backend.kernel, x, x, Slopes.NONE)
    expected = np.array([backend.forces(row) for row in x])
    np.testing.assert_array_equal(with_slopes, expected)
    np.testing.assert_array_equal(without, expected)


@every_mode
@every_network
def test_slopes_of_a_block_are_the_jacobian_by_the_body(name: str, mode: Mode) -> None:
    backend, x = compiled(name, mode), rows(mode, BLOCK, 1)
    _, slopes = block_forces(backend.kernel, x, x)
    _, jacobian = backend.forces_and_jacobian(x)
    scale = np.abs(jacobian[:, :, :3]).max(axis=0)
    assert np.max(np.abs(slopes - jacobian[:, :, :3]) / scale) < 1e-5


@every_mode
@every_network
def test_leading_slopes_are_near_the_exact_ones_and_cost_the_forces_no_bit(name: str, mode: Mode) -> None:
    backend, x = compiled(name, mode), rows(mode, BLOCK, 21)
    forces, exact = block_forces(backend.kernel, x, x)
    same_forces, leading = block_forces(backend.kernel, x, x, Slopes.LEADING)
    np.testing.assert_array_equal(same_forces, forces)
    if name == "plain":
        np.testing.assert_array_equal(leading, exact)
    else:
        assert np.linalg.norm(leading - exact) < 0.2 * np.linalg.norm(exact)


@every_mode
def test_a_block_takes_each_track_from_its_own_ground(mode: Mode) -> None:
    backend, left = compiled("structured", mode), rows(mode, BLOCK, 2)
    right = left.copy()
    right[:, 7:] = rows(mode, BLOCK, 3)[:, 7:]
    forces, _ = block_forces(backend.kernel, left, right)
    np.testing.assert_array_equal(forces, backend.track_forces(left, right).sum(axis=1))


@every_mode
@pytest.mark.parametrize("wanted", Slopes)
def test_what_is_prepared_serves_every_motion_of_the_body(mode: Mode, wanted: Slopes) -> None:
    backend, x = compiled("structured", mode), rows(mode, BLOCK)
    still = x.copy()
    still[:, :3] = 0.0
    own, other = (block_forces(backend.kernel, x, x, wanted, prepared_from=each) for each in (x, still))
    np.testing.assert_array_equal(own[0], other[0])
    if wanted:
        np.testing.assert_array_equal(own[1], other[1])


@every_mode
@every_network
def test_a_lane_that_is_not_a_number_leaves_the_others_alone(name: str, mode: Mode) -> None:
    backend, x = compiled(name, mode), rows(mode, BLOCK, 4)
    expected, expected_slopes = block_forces(backend.kernel, x, x)
    for column in range(x.shape[1]):
        bad = x.copy()
        bad[5, column] = np.nan
        forces, slopes = block_forces(backend.kernel, bad, bad)
        others = np.arange(BLOCK) != 5
        np.testing.assert_array_equal(forces[others], expected[others])
        np.testing.assert_array_equal(slopes[others], expected_slopes[others])
        assert np.isnan(forces[5]).any()


@every_mode
@every_backend
def test_a_batch_is_its_rows_to_the_bit(name: str, mode: Mode) -> None:
    backend, x = compiled(name, mode), rows(mode, 77, 5)
    np.testing.assert_array_equal(backend.forces(x), np.array([backend.forces(row) for row in x]))


@every_mode
@every_network
def test_denormal_inputs_cost_no_accuracy(name: str, mode: Mode) -> None:
    backend = compiled(name, mode)
    assert isinstance(backend, NativeSurrogate)
    x = rows(mode, 40, 6)
    x[:, :5] *= 1e-310
    expected = backend.surrogate.reference_forces(x)
    assert np.max(np.abs(backend.forces(x) - expected)) < 1e-5 * np.abs(expected).max()


# --- float32 physics


@every_mode
@pytest.mark.parametrize("cells", [(2, 1), (16, 4), (33, 9)])
def test_float32_physics_is_within_1e_5_of_the_force_scale(mode: Mode, cells: tuple[int, int]) -> None:
    x = rows(mode, 400, 7)
    x[200:, :7] *= np.logspace(-7, 0, 200)[:, None]  # creeping, where differences of speeds are all that counts
    double, single = (PhysicsBackend(M113, mode, cells=cells, precision=p) for p in ("float64", "float32"))
    (expected, slopes), (found, found_slopes) = double.forces_and_jacobian(x), single.forces_and_jacobian(x)
    assert np.max(np.abs(found - expected) / np.sqrt(np.mean(expected**2, axis=0))) < 1e-5
    largest = np.abs(slopes).max(axis=0)
    assert np.max(np.abs(found_slopes - slopes) / np.where(largest > 0, largest, 1.0)) < 1e-5


@every_mode
def test_float32_physics_is_symmetric_and_knows_its_resolution(mode: Mode) -> None:
    backend, x = compiled("single", mode), rows(mode, 30, 8)
    np.testing.assert_array_equal(backend.forces(interface(mode).mirror(x)), mirror_forces(backend.forces(x)))
    assert backend.resolution == np.finfo(np.float32).eps
    assert backend.describe()["precision"] == "float32"
    again = make_backend("physics", mode=mode, vehicle=M113, cells=(4, 2), precision="float32")
    np.testing.assert_array_equal(again.forces(x), backend.forces(x))


def test_the_exact_path_is_in_float64_alone() -> None:
    with pytest.raises(InvalidInputError, match="precision"):
        make_backend("exact", mode="rigid", vehicle=M113, precision="float32")


# --- one vehicle with the slopes that Newton asks for


@every_mode
@pytest.mark.parametrize("name", ["physics", "single"])
def test_forces_of_a_body_come_with_its_share_of_the_jacobian(name: str, mode: Mode) -> None:
    backend, left = compiled(name, mode), rows(mode, 12, 17)
    right = left.copy()
    right[:, 7:] = rows(mode, 12, 18)[:, 7:]
    for x_left, x_right in zip(left, right, strict=True):
        together, slopes = body_forces(backend.kernel, x_left, None)
        forces, jacobian = backend.forces_and_jacobian(x_left)
        np.testing.assert_array_equal(together, forces)
        np.testing.assert_allclose(slopes, jacobian[:, :3], rtol=1e-12, atol=1e-9 * np.abs(jacobian).max())
        apart, slopes = body_forces(backend.kernel, x_left, x_right)
        tracks, by_track = backend.track_forces_and_jacobian(x_left, x_right)
        np.testing.assert_array_equal(apart, tracks[0].sum(axis=0))
        expected = by_track[0].sum(axis=0)[:, :3]
        np.testing.assert_allclose(slopes, expected, rtol=1e-12, atol=1e-9 * np.abs(expected).max())


@every_mode
@every_network
@pytest.mark.parametrize("wanted", Slopes)
def test_a_body_alone_is_a_lane_of_a_block_to_the_bit(name: str, mode: Mode, wanted: Slopes) -> None:
    backend, left = compiled(name, mode), rows(mode, BLOCK, 19)
    right = left.copy()
    if name == "structured":
        right[:, 7:] = rows(mode, BLOCK, 20)[:, 7:]
    forces, slopes = block_forces(backend.kernel, left, right, wanted)
    for lane in range(BLOCK):
        alone, alone_slopes = body_forces(backend.kernel, left[lane], right[lane], wanted)
        np.testing.assert_array_equal(alone, forces[lane])
        if wanted is not Slopes.NONE:
            np.testing.assert_array_equal(alone_slopes, slopes[lane])
        together, _ = body_forces(backend.kernel, left[lane], None, wanted)
        np.testing.assert_array_equal(together, backend.forces(left[lane]))


# --- bound arrays


@every_mode
@every_backend
def test_a_bound_call_evaluates_what_its_arrays_hold(name: str, mode: Mode) -> None:
    backend, x = compiled(name, mode), rows(mode, 6, 9)
    held, forces, jacobian = np.empty_like(x), np.empty((6, 3)), np.empty((6, 3, x.shape[1]))
    held[:] = x[0]
    step = backend.bind(held, forces, jacobian)
    held[:] = x
    step()
    expected, slopes = backend.forces_and_jacobian(x)
    np.testing.assert_array_equal(forces, expected)
    np.testing.assert_array_equal(jacobian, slopes)


@every_backend
def test_a_bound_call_takes_a_single_row_and_holds_its_arrays(name: str) -> None:
    backend, x = compiled(name, "rigid"), rows("rigid", 3, 10)
    forces = np.empty(3)
    step = backend.bind(x[1].copy(), forces)
    step()
    np.testing.assert_array_equal(forces, backend.forces(x[1]))


@every_backend
def test_a_bound_call_refuses_a_bad_row_and_writes_nothing(name: str) -> None:
    backend, row, forces = compiled(name, "rigid"), rows("rigid", 2, 11)[1], np.full(3, 7.0)
    step = backend.bind(row, forces)
    row[3] = np.inf
    with pytest.raises(ValueError, match="column ax"):
        step()
    assert np.all(forces == 7.0)


@every_backend
def test_arrays_that_cannot_be_bound_are_refused(name: str) -> None:
    backend, x = compiled(name, "rigid"), rows("rigid", 4, 12)
    shared = np.zeros(80)
    locked = np.empty((4, 3))
    locked.flags.writeable = False
    shifted = np.frombuffer(bytearray(8 * 12 + 1), dtype=np.uint8)[1:][: 8 * 12].view(np.float64).reshape(4, 3)
    for arrays in (
        (x.astype(np.float32), np.empty((4, 3))),
        (x[:, ::-1], np.empty((4, 3))),
        (x, np.empty((5, 3))),
        (x, np.empty((4, 3))[:, ::-1]),
        (x, locked),
        (x, shifted),
        (shared[:40].reshape(4, 10), shared[38:50].reshape(4, 3)),
        (x, np.empty((4, 3)), np.empty((4, 3, 9))),
        (x, np.empty((4, 3)), None, None),
    ):
        with pytest.raises((InvalidInputError, TypeError)):
            backend.bind(*arrays)


@every_backend
def test_input_and_output_that_share_memory_are_refused(name: str) -> None:
    kernel = compiled(name, "rigid").kernel
    shared = rows("rigid", 1, 13).ravel()
    with pytest.raises(ValueError, match="share memory"):
        kernel.forces(shared, shared[7:10])


@every_backend
def test_no_rows_are_no_work(name: str) -> None:
    backend = compiled(name, "rigid")
    assert backend.forces(np.empty((0, 10))).shape == (0, 3)
    backend.bind(np.empty((0, 10)), np.empty((0, 3)))()


@every_backend
def test_threads_with_arrays_of_their_own_do_not_meet(name: str) -> None:
    backend, x = compiled(name, "rigid"), rows("rigid", 64, 14)
    expected = backend.forces(x)
    results = [np.empty((64, 3)) for _ in range(4)]
    steps = [backend.bind(x, forces) for forces in results]

    def work(step: Callable[[], None]) -> None:
        for _ in range(50):
            step()

    threads = [threading.Thread(target=work, args=(step,)) for step in steps]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for forces in results:
        np.testing.assert_array_equal(forces, expected)


# --- surrogate, detector and fallback in one call


@every_mode
def test_the_compiled_gate_is_the_gate(mode: Mode) -> None:
    guarded = make_backend("guarded", mode=mode, vehicle=M113)
    x = rows(mode, 200, 15)
    x[::7, 0] += 20.0
    outside = guarded.out_of_distribution(x)  # type: ignore[attr-defined]
    assert 0.1 < outside.mean() < 0.9
    native, physics = NativeSurrogate(M113, mode), PhysicsBackend(M113, mode)
    expected = np.where(outside[:, None], physics.forces(x), native.forces(x))
    np.testing.assert_array_equal(guarded.forces(x), expected)
    slopes = np.where(outside[:, None, None], physics.forces_and_jacobian(x)[1], native.forces_and_jacobian(x)[1])
    np.testing.assert_array_equal(guarded.forces_and_jacobian(x)[1], slopes)


# --- every level of the processor

PARITY = """
import sys
import numpy as np
from grouser.native import Mlp, cpu_level
from grouser.surrogate import NativeSurrogate, Surrogate
from grouser.terrain import PhysicsBackend, TrackedVehicle
vehicle, x = TrackedVehicle.preset("m113"), np.load(sys.argv[1])
native, plain = NativeSurrogate(vehicle, "rigid"), NativeSurrogate(vehicle, "rigid", "m113-rigid-paper-recipe")
physics, single = (PhysicsBackend(vehicle, "rigid", precision=p) for p in ("float64", "float32"))
np.savez(sys.argv[2], level=cpu_level(), physics=physics.forces_and_jacobian(x)[1], single=single.forces(x),
         native=native.forces(x), jacobian=native.forces_and_jacobian(x)[1], plain=plain.forces(x))
"""


def at_level(level: str, x: FloatArray, folder: Path) -> dict[str, FloatArray]:
    """What a process at that level computes; skips where the processor has none."""
    np.save(folder / "x.npy", x)
    command = [sys.executable, "-P", "-c", PARITY, str(folder / "x.npy"), str(folder / "out.npz")]
    done = subprocess.run(command, env=os.environ | {"GROUSER_CPU": level}, capture_output=True, text=True, check=False)
    if "this build and processor run" in done.stderr:
        pytest.skip(done.stderr.splitlines()[-1])
    assert done.returncode == 0, done.stderr
    with np.load(folder / "out.npz") as found:
        return dict(found)


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_agrees_with_the_oracles(level: str, tmp_path: Path) -> None:
    x = rows("rigid", 200, 16)
    found = at_level(level, x, tmp_path)
    assert found["level"] == level
    # float64 rounds alike at every level.
    np.testing.assert_array_equal(found["physics"], PhysicsBackend(M113, "rigid").forces_and_jacobian(x)[1])
    for name, artifact in (("native", "m113-rigid"), ("plain", "m113-rigid-paper-recipe")):
        expected = Surrogate.load(artifact).reference_forces(x)
        assert np.max(np.abs(found[name] - expected) / expected.std(axis=0)) < 1e-5
    expected = PhysicsBackend(M113, "rigid").forces(x)
    assert np.max(np.abs(found["single"] - expected) / expected.std(axis=0)) < 1e-5
    expected = NativeSurrogate(M113, "rigid").forces_and_jacobian(x)[1]
    assert np.max(np.abs(found["jacobian"] - expected)) < 1e-4 * np.abs(expected).max()


def test_an_unknown_level_is_refused_with_those_that_there_are() -> None:
    command = [sys.executable, "-P", "-c", "import grouser.native"]
    done = subprocess.run(command, env=os.environ | {"GROUSER_CPU": "vax"}, capture_output=True, text=True, check=False)
    assert "GROUSER_CPU=vax" in done.stderr
    assert cpu_level() in done.stderr
    assert "portable" in done.stderr


# --- activations


@pytest.mark.parametrize(("activation", "function"), [(1, lambda z: z / (1.0 + np.exp(-z))), (2, np.tanh)])
def test_activations_are_right_to_a_millionth(activation: int, function: Callable[[FloatArray], FloatArray]) -> None:
    first, last = np.zeros((10, 3), np.float32), np.eye(3, dtype=np.float32)
    first[0] = 1.0
    zeros = np.zeros(3, np.float32)
    net = Mlp(
        activation=activation,
        widths=(10, 3, 3),
        parameters=b"".join(part.tobytes() for part in (first, zeros, last, zeros)),
        input_mean=np.zeros(10),
        input_scale=np.ones(10),
        output_mean=np.zeros(3),
        output_scale=np.ones(3),
    )
    x = np.zeros((20001, 10))
    x[:, 0] = np.linspace(-20.0, 20.0, 20001).astype(np.float32)
    found = np.empty((20001, 3))
    net.forces(x, found)
    error = np.abs(found[:, 0] - function(x[:, 0])) / np.maximum(1.0, np.abs(x[:, 0]))
    assert error.max() < 1e-6
