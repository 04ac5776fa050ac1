"""The C of whole vehicles stands on its own: no Python, C99 as well as C11 and C++17, no warnings."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from grouser.envs import STATE_NAMES, BeltCommand, Simulator
from grouser.terrain import PhysicsBackend, RigidTerrain, SlopedGround, TrackedVehicle

NATIVE = Path(__file__).resolve().parents[2] / "native"
CORES = ["detector", "guard", "ground", "body", "tick"]
ENGINE = [
    *CORES,
    "load_block",
    "slip_power",
    "fleet_arrays",
    "fleet_block",
    "fleet_deck",
    "fleet_lanes",
    "fleet",
    "threads",
]
COMPILER = shutil.which("cc")
M113 = TrackedVehicle.preset("m113")

pytestmark = pytest.mark.skipif(COMPILER is None or not NATIVE.exists(), reason="needs a C compiler and the sources")

DRIVE = r"""
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "grouser/physics.h"
#include "grouser/tick.h"

static void evaluate(const void *block, const double *x, double *forces, double *jacobian) {
  grouser_physics_forces((const grouser_physics *)block, x, forces, jacobian);
}
static const char *refuses(const void *block, const double *x) {
  return grouser_physics_refuses((const grouser_physics *)block, x);
}

int main(void) {
  grouser_physics block = {GROUSER_RIGID, GROUSER_CONTINUOUS, GROUSER_SOFT_PATH, GROUSER_DOUBLE, 5, 2, 1, 11300, 9.81, 2.667,
                           2.667 / 5, 2.667 / 5, 2.159, 0.38, 0.79, 0, 0.1};
  grouser_kernel kernel = {&block, grouser_columns(block.mode), evaluate, refuses, NULL, NULL, NULL, NULL, NULL, 0, NULL};
  grouser_vehicle vehicle = {11300, 37300, 2.159, 0, 9.81, 0.2, 4.0};
  grouser_ground ground;
  grouser_plant plant;
  grouser_tick_record record;
  grouser_vehicle_state state = grouser_vehicle_at_rest();
  memset(&ground, 0, sizeof ground);
  ground.parameters = 3;
  ground.theta[0][0] = 0.7;
  ground.theta[0][1] = 0.04;
  ground.theta[0][2] = 0.02;
  ground.slope_x = tan(0.1);
  grouser_plant_init(&plant, &vehicle, &kernel, NULL, 0, GROUSER_IMPLICIT, 0.01, 1e-11);
  for (int tick = 0; tick < 200; tick++) {
    const double command[2] = {tick < 100 ? 4.0 : -1.0, tick < 50 ? 4.0 : 2.0};
    if (grouser_tick(&plant, &ground, command, &state, &record) != GROUSER_SOLVED) return 1;
  }
  printf("%.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g\n", state.x, state.y, state.heading,
         state.vx, state.vy, state.yaw_rate, state.v_left, state.v_right, state.ax, state.ay, state.time);
  state.vx = NAN;
  const double stop[2] = {0.0, 0.0};
  return grouser_tick(&plant, &ground, stop, &state, &record) == GROUSER_DIVERGED ? 0 : 2;
}
"""


@pytest.mark.parametrize("standard", ["c99", "c11", "c++17"])
def test_the_engine_is_read_without_a_warning(standard: str) -> None:
    language = ["-x", "c++"] if "++" in standard else ["-Wconversion"]
    sources = [str(NATIVE / "src" / f"{name}.c") for name in ENGINE]
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    assert COMPILER is not None
    if "++" in standard and shutil.which("c++") is None:
        pytest.skip("no C++ compiler")
    subprocess.run(
        [COMPILER, f"-std={standard}", "-fsyntax-only", *language, *warnings, f"-I{NATIVE}/include", *sources],
        check=True,
    )


def test_the_cores_need_nothing_but_the_mathematical_library() -> None:
    for name in CORES:
        text = (NATIVE / "src" / f"{name}.c").read_text()
        assert "Python.h" not in text
        assert "malloc" not in text
        assert "pthread" not in text


def test_a_program_in_c_moves_the_vehicle_as_the_simulator_does(tmp_path: Path) -> None:
    (tmp_path / "drive.c").write_text(DRIVE)
    names = [*CORES, "physics", "load", "soft_cells", "soft_cells_single", "exact_cells"]
    sources = [str(NATIVE / "src" / f"{name}.c") for name in names]
    program = str(tmp_path / "drive")
    assert COMPILER is not None
    flags = ["-std=c11", "-O1", "-ffp-contract=off", f"-I{NATIVE}/include"]
    subprocess.run([COMPILER, *flags, str(tmp_path / "drive.c"), *sources, "-lm", "-o", program], check=True)
    found = np.array(subprocess.run([program], check=True, capture_output=True, text=True).stdout.split(), float)
    ground = SlopedGround(RigidTerrain(mu=0.7, fr=0.04, k=0.02), grade=0.1)
    simulator = Simulator(M113, PhysicsBackend(M113, "rigid", cells=(2, 1)), ground)
    for tick in range(200):
        state = simulator.step(BeltCommand(4.0 if tick < 100 else -1.0, 4.0 if tick < 50 else 2.0)).state
    np.testing.assert_allclose(found, [getattr(state, name) for name in STATE_NAMES], rtol=0, atol=1e-9)
