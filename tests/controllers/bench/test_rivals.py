"""Every rival computes the forces of the network, or of the physics, that it is timed against."""

import os
import subprocess
import sys
from collections.abc import Callable
from importlib.machinery import ModuleSpec
from pathlib import Path

import numpy as np
import pytest

from grouser.controllers.bench import limits as limits_module
from grouser.controllers.bench import onnx_in_c as onnx_module
from grouser.controllers.bench.absences import Absences
from grouser.controllers.bench.calls import Calls
from grouser.controllers.bench.compiled_rivals import PLAIN_FLAGS, plain_network, scalar_physics
from grouser.controllers.bench.driving_network import driving_network
from grouser.controllers.bench.limits import PEAK, READS, Limits, bound, products
from grouser.controllers.bench.onnx_in_c import onnx_in_c, onnx_library
from grouser.controllers.bench.python_rivals import PythonRival, casadi_rival, numpy_rival, onnx_rivals, torch_rivals
from grouser.controllers.bench.subjects import Subjects, folded
from grouser.controllers.bench.timing import Effort, Section, measure
from grouser.controllers.bench.toolchain import Toolchain, Unit
from grouser.surrogate import NUMPY_NETWORK, DenseNetwork, Surrogate
from grouser.surrogate.threads import torch_threads
from grouser.terrain import ConfigurationError, FloatArray, TrackedVehicle

HIDDEN = (24, 16)


@pytest.fixture(scope="module")
def subjects() -> Subjects:
    return Subjects(TrackedVehicle.preset("m113"))


@pytest.fixture(scope="module")
def surrogate(subjects: Subjects) -> Surrogate:
    return subjects.plain(HIDDEN)


@pytest.fixture(scope="module")
def toolchain() -> Toolchain:
    found = Toolchain.find()
    if found is None:
        pytest.skip("no C compiler")
    return found


def close(forces: FloatArray, expected: FloatArray) -> None:
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_array_less(np.abs(forces - expected) / scale, 1e-4)


def oracle(surrogate: Surrogate, rows: FloatArray) -> FloatArray:
    z = surrogate.network.forward(NUMPY_NETWORK, surrogate.input_normalizer.normalize(rows))
    forces: FloatArray = surrogate.output_normalizer.denormalize(z)
    return forces


def test_the_rows_are_a_drive_inside_the_distribution(subjects: Subjects) -> None:
    assert subjects.rows.shape == (256, 10)
    assert not subjects.guarded.out_of_distribution(subjects.rows).any()
    assert len(np.unique(subjects.rows, axis=0)) == 256


def test_the_driving_network_turns_the_vehicle_as_the_physics_does_and_is_always_alike(subjects: Subjects) -> None:
    pytest.importorskip("torch")
    with torch_threads(1):
        first, second = (driving_network(subjects, (64, 64), steps=400) for _ in range(2))
    assert first.surrogate.network.packed() == second.surrogate.network.packed()
    forces, expected = first.forces(subjects.rows), subjects.physics((16, 4)).forces(subjects.rows)
    for output in (1, 2):
        assert np.corrcoef(forces[:, output], expected[:, output])[0, 1] > 0.9


@pytest.mark.parametrize("flags", PLAIN_FLAGS.values(), ids=lambda flags: flags[0])
def test_plain_c(
    flags: tuple[str, ...], toolchain: Toolchain, surrogate: Surrogate, subjects: Subjects, tmp_path: Path
) -> None:
    rival = plain_network(toolchain, tmp_path, f"plain{flags[0]}", folded(surrogate), flags)
    close(rival.forces(subjects.rows[:9]), oracle(surrogate, subjects.rows[:9]))
    assert rival.burst(subjects.rows)(3) > 0


def test_onnx_runtime_called_from_c(
    toolchain: Toolchain, surrogate: Surrogate, subjects: Subjects, tmp_path: Path
) -> None:
    for package in ("onnx", "onnxruntime"):
        pytest.importorskip(package)
    rival = onnx_in_c(toolchain, tmp_path, "onnx", folded(surrogate), subjects.rows[:9], onnx_library())
    close(rival.forces(subjects.rows[9:20]), oracle(surrogate, subjects.rows[9:20]))
    assert rival.burst(subjects.rows)(3) > 0


def test_onnx_runtime_neither_reports_nor_leaves_files(tmp_path: Path) -> None:
    for package in ("onnx", "onnxruntime"):
        pytest.importorskip(package)
    code = """
import numpy as np
from grouser.controllers.bench.python_rivals import onnx_rivals
from grouser.surrogate import random_network

onnx_rivals(random_network((10, 4, 3), "relu", np.random.default_rng(0)), np.zeros((1, 10), np.float32))
"""
    environment = {name: value for name, value in os.environ.items() if name != "ORT_DISABLE_TELEMETRY"}
    subprocess.run([sys.executable, "-P", "-c", code], check=True, env=environment | {"TMPDIR": str(tmp_path)})
    assert not list(tmp_path.iterdir())


# Functions that all answer with success, but those whose places are given here.
PRETENDED = """
typedef void function(void);
static void *succeed(void) { return 0; }
static void *fail(void) { return "it would rather not"; }
static function *table[200];
static function *const *functions(unsigned version) {
  for (int n = 0; n < 200; n++) table[n] = (function *)succeed;
  table[2] = (function *)fail;
  %s
}
static const char *version(void) { return "0.1"; }
static const struct { function *const *(*functions)(unsigned); const char *(*version)(void); } base = {functions, version};
const void *OrtGetApiBase(void) { return &base; }
"""


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        ("return 0;", "refuses: version 0.1 has no C API 20"),
        ("table[8] = (function *)fail; return table;", "refuses: it would rather not"),
        ("return table;", "off by 1.0e"),
    ],
    ids=["too old", "model refused", "nothing computed"],
)
def test_an_onnx_runtime_that_does_not_do_its_work_is_not_timed(
    answer: str,
    reason: str,
    toolchain: Toolchain,
    surrogate: Surrogate,
    subjects: Subjects,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(onnx_module, "onnx_model", lambda *_: b"model")
    toolchain.library(tmp_path, "pretended", [Unit(PRETENDED % answer, ("-O2",))])
    with pytest.raises(ConfigurationError, match=reason):
        onnx_in_c(toolchain, tmp_path, "caller", folded(surrogate), subjects.rows, tmp_path / "pretended.so")


def test_where_onnx_runtime_is_not_installed_it_says_how_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(onnx_module, "find_spec", lambda name: None)
    with pytest.raises(ConfigurationError, match=r"onnxruntime.*bench"):
        onnx_library()


def test_an_onnxruntime_without_a_library_of_its_own_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    package = ModuleSpec("onnxruntime", None, origin=str(tmp_path / "__init__.py"))
    monkeypatch.setattr(onnx_module, "find_spec", lambda name: package)
    with pytest.raises(ConfigurationError, match="no library that C could call"):
        onnx_library()


def test_scalar_physics(toolchain: Toolchain, subjects: Subjects, tmp_path: Path) -> None:
    physics = subjects.physics((4, 2))
    rival = scalar_physics(toolchain, tmp_path, physics)
    np.testing.assert_allclose(rival.forces(subjects.rows[:9]), physics.forces(subjects.rows[:9]), rtol=1e-9, atol=1e-6)


RIVALS: dict[str, Callable[[DenseNetwork, np.ndarray], dict[str, PythonRival]]] = {
    "numpy": lambda network, rows: {"NumPy": numpy_rival(network, rows)},
    "torch": torch_rivals,
    "onnxruntime": onnx_rivals,
    "casadi": lambda network, rows: {"CasADi": casadi_rival(network, rows)},
}


@pytest.mark.parametrize("library", RIVALS)
def test_libraries(library: str, surrogate: Surrogate, subjects: Subjects) -> None:
    pytest.importorskip(library)
    if library == "onnxruntime":
        pytest.importorskip("onnx")
    rows = subjects.rows[:1] if library == "casadi" else subjects.rows[:5]
    for rival in RIVALS[library](folded(surrogate), rows.astype(np.float32)).values():
        close(rival.forces(), oracle(surrogate, rows))
        assert rival.burst(2) > 0


def test_the_limits_bound_a_network(toolchain: Toolchain, tmp_path: Path) -> None:
    limits, times = Limits(toolchain, tmp_path), Section("ns", "")
    measure(times, limits.contenders(), Effort(2, 1e-4), lambda *_: None)
    rates = limits.rates(times)
    assert not times.figures
    assert set(rates.figures["this core"]) == {*READS, PEAK}
    assert all(value > 0 for value in rates.figures["this core"].values())
    widths = (10, 64, 64, 3)
    assert products(widths) == 10 * 64 + 64 * 64 + 64 * 3
    found = bound(rates, widths)
    assert found is not None
    assert found.least == max(found) > 0
    assert bound(Section("", ""), widths) is None


def test_what_exceeds_the_first_cache_is_read_from_the_second(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits_module, "first_level_cache", lambda: 1000)
    rates = Section("", "", {"this core": {**dict(zip(READS, (100.0, 50.0, 10.0), strict=True)), PEAK: 8.0}})
    found = bound(rates, (9, 100, 2))
    assert found is not None
    size = 4 * (9 * 100 + 100 * 2 + 102)
    assert found.read == pytest.approx(1000 / 100 + (size - 1000) / 10)
    assert found.compute == pytest.approx(2 * 1100 / 8)


def test_a_compiler_that_refuses_is_named(toolchain: Toolchain, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="refuses"):
        toolchain.library(tmp_path, "broken", [Unit("int x = ;", ("-O2",))])


def test_without_a_compiler_its_rivals_are_absent_with_the_reason(subjects: Subjects, tmp_path: Path) -> None:
    absent = Absences()
    calls = Calls(subjects, None, tmp_path, absent)
    assert {contender.name for contender in calls.networks_in_c()} == {"grouser", "grouser, with Jacobian"}
    assert "no C compiler" in absent["rivals and limits in C"]


def test_no_compiler_is_found_on_an_empty_path(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    assert Toolchain.find() is None
