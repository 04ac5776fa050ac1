"""The compiled cells: grids beyond what is summed at once, lifted elements, mirror images, what the levels share."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from grouser.terrain import (
    MODES,
    CompiledBackend,
    ExactBackend,
    FloatArray,
    Mode,
    PhysicsBackend,
    ShearGrid,
    ShearPath,
    TrackedVehicle,
    block_forces,
    casadi_namespace,
    interface,
    mirror_forces,
    parameter_ranges,
    reference_forces,
)

M113, WARTHOG = TrackedVehicle.preset("m113"), TrackedVehicle.preset("warthog")
BACKENDS: dict[ShearPath, type[PhysicsBackend]] = {"soft": PhysicsBackend, "exact": ExactBackend}
# A lone cell; lanes that are left over; one run of stations and one strip of columns exceeded by one each.
GRIDS = [(1, 1), (3, 5), (26, 65), (27, 64)]
every_mode = pytest.mark.parametrize("mode", MODES)
every_path = pytest.mark.parametrize("path", BACKENDS)


def rows(mode: Mode, count: int, seed: int = 0) -> FloatArray:
    """States that slide, turn and, every third of them, lift elements off the ground."""
    generator = np.random.default_rng(seed)
    ranges = parameter_ranges("paper", mode)
    theta = ranges.at(generator.uniform(size=(count, len(ranges.low))))
    motion = generator.normal((3.0, 0.0, 0.0), (2.0, 0.5, 0.6), (count, 3))
    belts = motion[:, :1] + generator.normal(0.0, 1.0, (count, 2))
    accelerations = generator.normal(0.0, 1.5, (count, 2))
    accelerations[::3] *= 5.0
    return np.column_stack([motion, accelerations, belts, theta])


@pytest.mark.parametrize("cells", GRIDS)
@every_path
@every_mode
def test_any_grid_is_summed_as_the_oracle_sums_it(mode: Mode, path: ShearPath, cells: tuple[int, int]) -> None:
    x = rows(mode, 24)
    expected = reference_forces(M113, mode, x, grid=ShearGrid(*cells, "continuous", path))
    found = BACKENDS[path](M113, mode, cells=cells).forces(x)
    assert np.max(np.abs(found - expected) / expected.std(axis=0)) < 1e-9  # the promise of the design


@every_path
@every_mode
def test_patches_with_gaps_are_summed_as_the_oracle_sums_them(mode: Mode, path: ShearPath) -> None:
    x = rows(mode, 24, 1)
    expected = reference_forces(WARTHOG, mode, x, grid=ShearGrid(5, 3, "per_wheel", path))
    found = BACKENDS[path](WARTHOG, mode, cells=(5, 3)).forces(x)
    assert np.max(np.abs(found - expected) / expected.std(axis=0)) < 1e-9


@every_path
@every_mode
def test_the_jacobian_holds_where_elements_lift_and_cohesion_fades(mode: Mode, path: ShearPath) -> None:
    casadi = pytest.importorskip("casadi")
    x = rows(mode, 60, 2)
    symbol = casadi.MX.sym("x", x.shape[1])
    force = block_forces(casadi_namespace(), M113, mode, symbol, grid=ShearGrid(2, 3, path=path))
    function = casadi.Function("jacobian", [symbol], [casadi.jacobian(force, symbol)])
    expected = np.array([function(row) for row in x])
    _, found = BACKENDS[path](M113, mode, cells=(2, 3)).forces_and_jacobian(x)
    scale = np.abs(expected).max(axis=0)
    assert np.max(np.abs(found - expected) / (scale + 1e-12 * scale.max())) < 1e-8


@pytest.mark.parametrize("cells", GRIDS)
@every_mode
def test_slopes_of_a_large_grid_are_those_of_its_forces(mode: Mode, cells: tuple[int, int]) -> None:
    backend = PhysicsBackend(M113, mode, cells=cells)
    x = rows(mode, 6, 3)
    x[:, 3:5] = 0.3  # clear of the corners where elements lift
    _, jacobian = backend.forces_and_jacobian(x)
    for column in range(x.shape[1]):
        step = np.zeros(x.shape[1])
        step[column] = 1e-5 * np.abs(x[:, column]).max()
        difference = (backend.forces(x + step) - backend.forces(x - step)) / (2 * step[column])
        scale = np.abs(jacobian).max(axis=(0, 2)) * max(1.0, 1e-3 / step[column])
        assert np.max(np.abs(difference - jacobian[:, :, column]) / scale) < 1e-5, interface(mode).names[column]


def blocks(mode: Mode, cells: tuple[int, int]) -> list[CompiledBackend]:
    return [
        PhysicsBackend(M113, mode, cells=cells),
        PhysicsBackend(M113, mode, cells=cells, precision="float32"),
        ExactBackend(M113, mode, cells=cells),
    ]


@pytest.mark.parametrize("cells", GRIDS)
@every_mode
def test_a_mirrored_row_gives_the_mirrored_force_to_the_bit(mode: Mode, cells: tuple[int, int]) -> None:
    x = rows(mode, 12, 4)
    for backend in blocks(mode, cells):
        mirrored = backend.forces(interface(mode).mirror(x))
        np.testing.assert_array_equal(mirrored, mirror_forces(backend.forces(x)))


@pytest.mark.parametrize("cells", GRIDS)
@every_mode
def test_forces_have_the_same_bits_with_a_jacobian_and_by_tracks(mode: Mode, cells: tuple[int, int]) -> None:
    x = rows(mode, 12, 5)
    for backend in blocks(mode, cells):
        forces = backend.forces(x)
        np.testing.assert_array_equal(backend.forces_and_jacobian(x)[0], forces)
        np.testing.assert_array_equal(backend.track_forces(x, x).sum(axis=1), forces)


@every_mode
def test_float32_holds_on_large_grids_where_elements_lift(mode: Mode) -> None:
    x = rows(mode, 120, 6)
    double, single = (PhysicsBackend(M113, mode, cells=(27, 65), precision=p) for p in ("float64", "float32"))
    (expected, slopes), (found, found_slopes) = double.forces_and_jacobian(x), single.forces_and_jacobian(x)
    assert np.max(np.abs(found - expected) / np.sqrt(np.mean(expected**2, axis=0))) < 1e-5
    largest = np.abs(slopes).max(axis=0)
    assert np.max(np.abs(found_slopes - slopes) / np.where(largest > 0, largest, 1.0)) < 1e-5


@pytest.mark.parametrize(
    ("backend", "tolerance"),
    [
        (PhysicsBackend(M113, "rigid"), 1e-13),
        (ExactBackend(M113, "rigid"), 1e-13),
        (PhysicsBackend(M113, "rigid", precision="float32"), 6e-7),
    ],
    ids=["soft", "exact", "float32"],
)
def test_the_saturation_is_as_near_to_its_closed_form_as_documented(backend: CompiledBackend, tolerance: float) -> None:
    """On locked tracks pushed sideways every cell has the same z = |Vy| L/(2 V_eps K): Qy = -mu W (1 - e^-z)."""
    z = np.concatenate([np.logspace(-10, 3, 400), np.log(2) * np.arange(0.5, 40, 0.5)])
    x = np.zeros((len(z), 10))
    x[:, 7:] = 0.7, 0.0, 0.05
    x[:, 1] = z * 2 * M113.soft_speed * 0.05 / M113.contact_length
    expected = 0.7 * M113.weight * np.expm1(-z)
    np.testing.assert_allclose(backend.forces(x)[:, 1], expected, rtol=tolerance + 4 * np.finfo(float).eps)


def stuck(slip: float) -> FloatArray:
    """Rows that slide by so little sideways, at rest and rolling, that only the first term of the shear is left."""
    return np.array([[v, slip, 0.0, 0.0, 0.0, v, v, 0.7, 0.05, 0.02] for v in (0.0, 1.0, -4.0)])


@pytest.mark.parametrize("slip", [1e-4, 1e-9, 1e-14])
@every_path
def test_a_little_slip_is_resisted_by_the_stiffness_that_the_jacobian_has(path: ShearPath, slip: float) -> None:
    forces, jacobian = BACKENDS[path](M113, "rigid").forces_and_jacobian(stuck(slip))
    # h changes by half of z, the slip over what it takes to shear the ground.
    z = np.abs(jacobian[:, 1, 1]) * slip / (0.7 * M113.weight)
    np.testing.assert_allclose(forces[:, 1], jacobian[:, 1, 1] * slip, rtol=1e-12 + 4 * z.max())


LEVEL = """
import sys
import numpy as np
from grouser.native import cpu_level
from grouser.terrain import ExactBackend, PhysicsBackend, TrackedVehicle
vehicle, x = TrackedVehicle.preset("m113"), np.load(sys.argv[1])
found = {"level": cpu_level()}
for name, backend in (("soft", PhysicsBackend), ("exact", ExactBackend)):
    found[name], found[name + "_slopes"] = backend(vehicle, "soil", cells=(3, 5)).forces_and_jacobian(x)
np.savez(sys.argv[2], **found)
"""


@pytest.mark.parametrize("level", ["portable", "x86-64-v3", "x86-64-v4"])
def test_either_path_has_the_same_bits_at_every_level(level: str, tmp_path: Path) -> None:
    x = rows("soil", 60, 7)
    np.save(tmp_path / "x.npy", x)
    command = [sys.executable, "-P", "-c", LEVEL, str(tmp_path / "x.npy"), str(tmp_path / "out.npz")]
    done = subprocess.run(command, env=os.environ | {"GROUSER_CPU": level}, capture_output=True, text=True, check=False)
    if "this build and processor run" in done.stderr:
        pytest.skip(done.stderr.splitlines()[-1])
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "out.npz") as found:
        assert found["level"] == level
        for path, backend in BACKENDS.items():
            forces, slopes = backend(M113, "soil", cells=(3, 5)).forces_and_jacobian(x)
            np.testing.assert_array_equal(found[path], forces)
            np.testing.assert_array_equal(found[f"{path}_slopes"], slopes)
