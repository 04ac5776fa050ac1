"""``grouser export c``: the verb, its options and its refusals."""

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
from exported import GCC


def test_a_shipped_name_becomes_files_that_pass_their_self_test(call: Any, tmp_path: Path) -> None:
    out = call("export", "c", "ugv-rigid", "-o", tmp_path / "ugv").out
    assert "grouser_ugv_rigid.c (" in out
    assert "artifact" in out
    assert {file.name for file in (tmp_path / "ugv").iterdir()} == {
        "grouser_ugv_rigid.h", "grouser_ugv_rigid.c", "grouser_ugv_rigid_sfun.c", "selftest.c", "CMakeLists.txt",
        "README.md", "LICENSE", "GrouserUgvRigidComponent.h", "GrouserUgvRigidComponent.cpp",
    }  # fmt: skip
    if GCC is None:
        pytest.skip("there is no gcc to compile the export with")
    shown = re.search(r"self-test +(cc .*)", out)
    assert shown
    done = subprocess.run(shown[1], shell=True, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "all checks passed" in done.stdout


def test_a_file_gives_its_name_unless_another_is_given(call: Any, artifact: Path, tmp_path: Path) -> None:
    call("export", "c", artifact, "-o", tmp_path / "a")
    assert (tmp_path / "a" / "grouser_small.c").is_file()
    call("export", "c", artifact, "-o", tmp_path / "b", "--name", "truck")
    assert (tmp_path / "b" / "grouser_truck.c").is_file()


def test_an_earlier_export_stays_unless_forced(call: Any, artifact: Path, tmp_path: Path) -> None:
    call("export", "c", artifact, "-o", tmp_path / "a")
    assert "is not empty" in call("export", "c", artifact, "-o", tmp_path / "a", code=2).err
    call("export", "c", artifact, "-o", tmp_path / "a", "--force")


def test_what_was_typed_wrong_is_named(call: Any, artifact: Path, tmp_path: Path) -> None:
    assert "cannot read artifact" in call("export", "c", "m114-rigid", "-o", tmp_path / "a", code=2).err
    assert "letters, digits" in call("export", "c", artifact, "-o", tmp_path / "a", "--name", "1st", code=2).err
    assert not (tmp_path / "a").exists()


def test_the_help_says_what_comes_out(call: Any) -> None:
    help_text = call("export", "c", "--help").out
    assert "S-function" in help_text
    assert "grouser export c m113-rigid -o build/m113-rigid-c" in help_text
