"""What goes wrong is one line on stderr, and exit code 2."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

MAIN = (sys.executable, "-P", "-c", "from grouser.cli import main; main()")


def line(called: Any) -> str:
    """Return the one line that an error is."""
    assert called.out == ""
    (only,) = called.err.splitlines()
    assert only.startswith("error: ")
    return str(only)


def test_main_leaves_with_the_code_and_without_a_traceback(tmp_path: Path) -> None:
    done = subprocess.run(
        [*MAIN, "data", str(tmp_path / "x"), "--vehicle", "m114"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == (
        "error: unknown vehicle 'm114'; did you mean 'm113'? (known: m113, marder, maxxii, ugv, warthog)\n"
    )
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["drive", "--backend", "physics", "--path", "iso-3888"], "did you mean 'iso-3888-1'?"),
        (["drive", "--backend", "physics", "--terrain", "asfalt"], "did you mean 'asphalt'?"),
        (["drive", "--backend", "phyzics"], "did you mean 'physics'?"),
        (["drive", "--backend", "physics", "--controller", "mcp"], "did you mean 'mpc'?"),
        (["drive", "--backend", "physics", "--render", "film.mp4"], "FILE.gif"),
        (["drive", "--backend", "physics", "--artifact", "none", "--speed", "-1"], "speed must lie in"),
        (["compare", "--backends", "physics,physics"], "different names"),
        (["train", "no-folder", "x.safetensors"], "make one: grouser data"),
        (["train", "no-folder", "x.safetensors", "--hidden", "big"], "whole numbers such as 128,128"),
        (["train", "no-folder", "x.safetensors", "--output-weights", "1,x"], "numbers such as 1,1,3"),
        (["evaluate", "none.safetensors", "no-folder"], "cannot read artifact"),
        (["rl", "eval", "none.safetensors"], "cannot read policy"),
    ],
)  # fmt: skip
def test_what_was_typed_wrong_is_named(call: Any, arguments: list[str], expected: str) -> None:
    assert expected in line(call(*arguments, code=2))


def test_a_truncated_artifact(call: Any, artifact: Path, dataset: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.safetensors"
    cut.write_bytes(artifact.read_bytes()[:-100])
    for arguments in (("evaluate", cut, dataset), ("drive", "--artifact", cut), ("compare", "--artifact", cut)):
        assert "truncated" in line(call(*arguments, code=2))


def test_a_policy_is_no_surrogate_and_the_reverse(call: Any, artifact: Path) -> None:
    assert "does not hold a policy" in line(call("rl", "eval", artifact, code=2))


def test_a_path_file_that_holds_none(call: Any, tmp_path: Path) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text("x,y\n0,0\n1,a\n")
    assert "bad.csv, line 3: y must be a number in m, got 'a'" in line(
        call("drive", "--backend", "physics", "--path", bad, code=2)
    )


def test_a_file_in_the_way_is_named(call: Any, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    assert line(call("data", tmp_path / "taken", "--runs", 1, code=2)).endswith("taken/parts: Not a directory")


def test_debug_shows_the_traceback(call: Any, tmp_path: Path) -> None:
    err = call("--debug", "data", tmp_path / "x", "--vehicle", "m114", code=2).err
    assert "Traceback" in err
    assert err.splitlines()[-1].startswith("error: unknown vehicle 'm114'")


@pytest.mark.parametrize(
    ("arguments", "interrupted", "expected"),
    [
        (["data", "x"], "grouser.surrogate.offline.generate_dataset", "finished runs are kept"),
        (["demo"], "grouser.controllers.demonstration.run_demonstration", "goes on from there"),
        (["train", "x", "y.safetensors"], "grouser.surrogate.offline.load_dataset", "ends at the same weights"),
        (["rl", "train", "path-tracking", "-o", "x"], "grouser.controllers.train_policy", "goes on with --resume"),
        (["evaluate", "x", "y"], "grouser.surrogate.Surrogate.load", "nothing was kept"),
    ],
)
def test_an_interruption_says_what_it_leaves(
    call: Any, arguments: list[str], interrupted: str, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(interrupted, interrupt)
    assert expected in call(*arguments, code=130).err


def test_an_unexpected_error_is_not_hidden(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("grouser.cli.doctor.backend_names", fail)
    call("doctor", code=1)
