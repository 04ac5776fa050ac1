"""What compilers, linkers and sanitizers say of the exported files."""

import os
import platform
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exported import CLANG, GCC, WARNINGS, Exported, compiled

from grouser.surrogate import GuardedSurrogate, Surrogate, export_c
from grouser.terrain import FloatArray, PhysicsBackend, SwitchingPolicy, TrackedVehicle

SUPPORT = Path(__file__).parents[2] / "support"
# Beside C99 by gcc with optimization, which the fixture compiles.
COMPILERS = {
    "gcc-gnu17": (GCC, ("-std=gnu17",)),
    "gcc-c++17": (GCC, ("-x", "c++", "-std=c++17")),
    "clang-c99": (CLANG, ("-std=c99",)),
    "clang-c++17": (CLANG, ("-x", "c++", "-std=c++17")),
}
#: The vectors that a level brings change the code; what gcc says of bounds, it says when it optimizes.
WIDER = {
    "gcc-v4": (GCC, ("-O2", "-march=x86-64-v4", "-S", "-o", os.devnull)),
    "clang-v3": (CLANG, ("-march=x86-64-v3", "-fsyntax-only")),
    "clang-v4": (CLANG, ("-march=x86-64-v4", "-fsyntax-only")),
}
#: What the export may ask of the C library.
LIBRARY = {
    "sqrt",
    "sqrtf",
    "exp",
    "expm1",
    "sin",
    "cos",
    "tan",
    "fmin",
    "fmax",
    "copysign",
    "memcpy",
    "memset",
    "strcmp",
}
# What gcc makes of these: both of an angle at once, a structure copied.
LIBRARY |= {"sincos", "memmove"}
structured_rigid = pytest.mark.parametrize("artifact", ["m113-rigid"])
# Modes differ in their tables alone.
each_family = pytest.mark.parametrize("artifact", ["m113-rigid", "m113-rigid-paper-recipe"])


@each_family
@pytest.mark.parametrize("compiler", COMPILERS)
def test_no_compiler_warns(code: Exported, compiler: str) -> None:
    program, language = COMPILERS[compiler]
    if program is None:
        pytest.skip(f"{compiler.split('-')[0]} is not installed")
    compiled([program, *language, *WARNINGS, "-fsyntax-only", code.source.name, "selftest.c"], code.folder)


@each_family
@pytest.mark.parametrize("compiler", WIDER)
def test_no_compiler_warns_of_wider_vectors(code: Exported, compiler: str) -> None:
    program, flags = WIDER[compiler]
    if program is None or platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip(f"{compiler.split('-')[0]} is not installed, or this is no x86-64")
    compiled([program, "-std=c99", *flags, *WARNINGS, code.source.name], code.folder)


@each_family
def test_the_self_test_is_clean_under_sanitizers(code: Exported, tmp_path: Path) -> None:
    program = tmp_path / "selftest"
    sanitizers = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    compiled([str(GCC), "-std=c99", "-g", *sanitizers, "selftest.c", code.source.name, "-lm", "-o", program],
             code.folder)  # fmt: skip
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "all checks passed" in done.stdout


@each_family
def test_there_is_no_state_no_heap_and_no_foreign_name(code: Exported, tmp_path: Path) -> None:
    made = tmp_path / "object.o"
    compiled([str(GCC), "-std=c99", "-O2", "-fno-pic", "-fno-stack-protector", "-U_FORTIFY_SOURCE", "-c",
              code.source.name, "-o", made], code.folder)  # fmt: skip
    symbols = subprocess.run(["nm", made], capture_output=True, text=True, check=True).stdout
    by_kind: dict[str, set[str]] = {}
    for kind, name in re.findall(r" ([A-Za-z]) (\w+)$", symbols, re.MULTILINE):
        by_kind.setdefault(kind, set()).add(name)
    assert not by_kind.keys() & set("bBdDcC"), by_kind
    assert by_kind["U"] <= LIBRARY
    assert all(name.startswith(f"{code.prefix}_") for kind in ("T", "R") for name in by_kind[kind])


def test_cmake_builds_library_and_self_test(exported: Callable[[str], Exported], tmp_path: Path) -> None:
    code = exported("m113-rigid")
    cmake = pytest.importorskip("cmake")
    program = Path(cmake.CMAKE_BIN_DIR) / "cmake"
    compiled([program, "-S", code.folder, "-B", tmp_path, "-DCMAKE_BUILD_TYPE=Release"], tmp_path)
    compiled([program, "--build", tmp_path], tmp_path)
    assert (tmp_path / f"lib{code.prefix}.a").is_file()
    compiled([tmp_path / "selftest"], tmp_path)


def test_two_exports_fit_into_one_program(exported: Callable[[str], Exported], tmp_path: Path) -> None:
    codes = [exported(artifact) for artifact in ("m113-rigid", "ugv-soil")]
    main = tmp_path / "main.c"
    includes = "".join(f'#include "{code.prefix}.h"\n' for code in codes)
    calls = " | ".join(f"{code.prefix}_self_test()" for code in codes)
    main.write_text(f"{includes}int main(void) {{ return {calls}; }}\n")
    folders = [f"-I{code.folder}" for code in codes]
    sources = [code.source for code in codes]
    compiled([str(GCC), "-std=c99", *WARNINGS, *folders, main, *sources, "-lm", "-o", tmp_path / "both"], tmp_path)
    compiled([tmp_path / "both"], tmp_path)


@structured_rigid
def test_a_compiler_without_vectors_passes_the_self_test(code: Exported, artifact: str, tmp_path: Path) -> None:
    text = code.source.read_text()
    assert "#if defined(__GNUC__)\n" in text
    (tmp_path / code.source.name).write_text(text.replace("defined(__GNUC__)", "0"))
    compiled([str(GCC), "-std=c99", *WARNINGS, f"-I{code.folder}", code.folder / "selftest.c", code.source.name,
              "-lm", "-o", "selftest"], tmp_path)  # fmt: skip
    compiled([tmp_path / "selftest"], tmp_path)


@structured_rigid
def test_an_altered_number_fails_the_self_test(code: Exported, artifact: str, tmp_path: Path) -> None:
    text = code.source.read_text()
    weight = re.search(r"weights_1\[\d+\] = \{\s*(-?[\d.e-]+)f", text)
    assert weight
    mass = re.search(r"grouser_m113_rigid_physics physics = \{[^}]*?(11300\.0)", text, re.DOTALL)
    assert mass
    for found, check in ((weight, 1), (mass, 4)):
        altered = text[: found.start(1)] + repr(float(found[1]) * 1.001) + text[found.end(1) :]
        (tmp_path / code.source.name).write_text(altered)
        program = tmp_path / "selftest"
        compiled([str(GCC), f"-I{code.folder}", code.folder / "selftest.c", code.source.name, "-lm", "-o", program],
                 tmp_path)  # fmt: skip
        done = subprocess.run([program], capture_output=True, text=True, check=False)
        assert done.returncode == 1
        assert f"check {check} failed" in done.stdout


@structured_rigid
def test_the_same_artifact_gives_the_same_bytes(code: Exported, surrogate: Surrogate, tmp_path: Path) -> None:
    again = export_c(surrogate, tmp_path / "again", name=code.prefix.removeprefix("grouser_"))
    names = sorted(file.name for file in code.folder.iterdir())
    assert names == sorted(file.name for file in again.iterdir())
    for name in names:
        assert (code.folder / name).read_bytes() == (again / name).read_bytes(), name


def test_nothing_of_the_machine_is_in_the_files(code: Exported) -> None:
    whole = "".join(file.read_text() for file in code.folder.iterdir())
    for told in (str(Path.home()), os.getcwd(), str(code.folder.parent)):
        assert told not in whole
    assert not re.search(r"\b(19|20)\d\d-\d\d-\d\d\b|/home/|/tmp/", whole)


@structured_rigid
def test_the_s_function_runs_in_a_host(code: Exported, surrogate: Surrogate, tmp_path: Path, rows: FloatArray) -> None:
    program = tmp_path / "engine"
    compiled([str(GCC), "-std=c99", *WARNINGS, "-DMATLAB_MEX_FILE", f"-I{SUPPORT / 'simulink'}",
              f"{code.prefix}_sfun.c", code.source.name, "-lm", "-o", program], code.folder)  # fmt: skip
    rows[10:14, 0] = 40.0
    text = "\n".join(" ".join(map(repr, row.tolist())) for row in rows)
    done = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
    got = np.array([line.split() for line in done.stdout.splitlines()], dtype=np.float64)
    backend = GuardedSurrogate(surrogate.vehicle, surrogate.mode, surrogate)
    guard, policy = code.function("fresh_guard")(), SwitchingPolicy()
    assert backend.policy == policy
    expected = np.array([code.guarded(guard, 0.01, row)[0] for row in rows])
    np.testing.assert_array_equal(got[:, :3], expected)
    np.testing.assert_allclose(got[:, 3], surrogate.detector.score(rows), rtol=1e-9)
    physics = PhysicsBackend(surrogate.vehicle, surrogate.mode).forces(rows[10:14])
    np.testing.assert_allclose(got[10:14, :3], physics, rtol=1e-9)
    refused = subprocess.run(
        [program], input=text.replace("40.0", "nan", 1), capture_output=True, text=True, check=False
    )
    assert refused.returncode == 2
    assert "not finite" in refused.stdout


@structured_rigid
def test_the_unreal_component_compiles(code: Exported, tmp_path: Path) -> None:
    (component,) = code.folder.glob("Grouser*Component.cpp")
    (tmp_path / f"{component.stem}.generated.h").write_text("")
    compiled([str(GCC), "-x", "c++", "-std=c++17", "-fsyntax-only", *WARNINGS, f"-I{SUPPORT / 'unreal'}",
              f"-I{tmp_path}", component.name], code.folder)  # fmt: skip


def test_wheels_apart_and_an_exact_fallback_are_exported_too(
    make_structured: Callable[..., Surrogate], tmp_path: Path
) -> None:
    surrogate = make_structured("soil", "tanh", (8,), TrackedVehicle.preset("warthog"))
    teacher = {"backend": "exact", "cells": [4, 2], "soft_speed": 0.0}
    folder = export_c(replace(surrogate, recipe={"teacher": teacher}), tmp_path / "warthog")
    compiled([str(GCC), "-std=c99", *WARNINGS, "selftest.c", "grouser_warthog_soil.c", "-lm", "-o", "selftest"],
             folder)  # fmt: skip
    compiled([folder / "selftest"], folder)
    soft = export_c(surrogate, tmp_path / "soft") / "grouser_warthog_soil.c"
    assert "paths_at" in (folder / "grouser_warthog_soil.c").read_text()
    assert "paths_at" not in soft.read_text()
