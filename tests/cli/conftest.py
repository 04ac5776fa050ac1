"""The command line in this process, and what its first verbs make: a small dataset, surrogate and path."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from typer.testing import CliRunner

from grouser.cli import app

_ANSI = re.compile(r"\x1b\[[0-9;]*m")


class Called(NamedTuple):
    """What a call left: its exit code, and both streams without colours."""

    code: int
    out: str
    err: str


Call = Callable[..., Called]


def _call(*arguments: object, code: int = 0) -> Called:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    out, err = (_ANSI.sub("", text) for text in (result.stdout, result.stderr))
    assert result.exit_code == code, f"exit {result.exit_code}\n{out}\n{err}\n{result.exception!r}"
    return Called(result.exit_code, out, err)


@pytest.fixture(scope="session")
def call() -> Call:
    """Call grouser: ``call("data", folder, "--runs", 18)``; ``code`` is the exit code that must come."""
    return _call


@pytest.fixture(scope="session")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rigid dataset of a second. Not to be changed."""
    folder = tmp_path_factory.mktemp("cli") / "rigid"
    _call("data", folder, "--runs", 18, "--samples", 60, "--transient", 0.5, "--seed", 3, "--workers", 1)
    return folder


@pytest.fixture(scope="session")
def artifact(tmp_path_factory: pytest.TempPathFactory, dataset: Path) -> Path:
    """A surrogate of that dataset, too small to be good."""
    file = tmp_path_factory.mktemp("cli") / "small.safetensors"
    _call("train", dataset, file, "--hidden", "16,16", "--epochs", 4, "--batch-size", 256, "--learning-rate", 1e-2)
    return file


@pytest.fixture(scope="session")
def short_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A path of 15 m, driven in 3 s."""
    file = tmp_path_factory.mktemp("cli") / "short.csv"
    file.write_text("x,y\n0,0\n5,0\n10,0.2\n15,0.2\n")
    return file
