"""No compiler warns of the core: its files, flags and vector levels are those of its CMakeLists.txt."""

import os
import platform
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest

NATIVE = Path(__file__).resolve().parents[2] / "native"
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Werror")
LISTS = (NATIVE / "CMakeLists.txt").read_text(encoding="utf-8") if NATIVE.exists() else ""
SOURCES = re.findall(r"src/(\w+\.c)", LISTS.partition("Python_add_library")[2].partition(")")[0])
LEVELS: dict[str, str] = dict(re.findall(r"add_level\((\w+) [\w-]+((?: -[\w=-]+)*)\)", LISTS))

pytestmark = pytest.mark.skipif(not LISTS, reason="needs the sources")


@pytest.fixture(params=["gcc", "clang"])
def compiler(request: pytest.FixtureRequest) -> str:
    name = str(request.param)
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


@pytest.fixture(params=["-O0", pytest.param("-O3", marks=pytest.mark.slow)])
def optimization(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def refuse_warnings(compiler: str, *arguments: str) -> None:
    # To assembly and not -fsyntax-only, with which gcc says nothing of functions that nobody calls.
    command = [compiler, "-std=c11", "-ffp-contract=off", "-fno-math-errno", *WARNINGS, *arguments]
    done = subprocess.run(
        [*command, f"-I{NATIVE}/include", "-S", "-o", os.devnull], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stderr[:4000]}"


def test_the_lists_are_read_as_cmake_reads_them() -> None:
    assert {"tick.c", "fleet.c", "module.c"} <= set(SOURCES)
    assert all((NATIVE / "src" / name).is_file() for name in SOURCES)
    assert set(LEVELS) == {"portable", "v3", "v4"}
    assert "-mfma" in LEVELS["v3"].split()


def test_no_compiler_warns_of_the_engine(compiler: str, optimization: str) -> None:
    for name in SOURCES:
        if not name.startswith("module"):
            refuse_warnings(compiler, optimization, "-Wpedantic", str(NATIVE / "src" / name))


def test_no_compiler_warns_of_the_extension_module(compiler: str, optimization: str) -> None:
    headers = sysconfig.get_path("include")
    if not Path(headers, "Python.h").is_file():
        pytest.skip("Python's headers are not installed")
    for name in SOURCES:
        if name.startswith("module"):
            # Not pedantic: Python keeps functions in slots of type void *.
            interface = ("-DPy_LIMITED_API=0x030B0000", "-isystem", headers)
            refuse_warnings(compiler, optimization, *interface, str(NATIVE / "src" / name))


@pytest.mark.parametrize("level", LEVELS)
def test_no_compiler_warns_of_the_kernels(compiler: str, optimization: str, level: str) -> None:
    if LEVELS[level] and platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip("this is no x86-64")
    table = (f"-DGROUSER_LEVEL_TABLE=grouser_level_{level}", f'-DGROUSER_LEVEL_NAME="{level}"')
    refuse_warnings(
        compiler, optimization, "-Wpedantic", *LEVELS[level].split(), *table, str(NATIVE / "src" / "kernels.c")
    )
