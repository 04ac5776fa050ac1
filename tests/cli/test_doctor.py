"""What is installed, and help that works without it."""

import inspect
import subprocess
import sys
from dataclasses import fields
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import pytest

from grouser.cli.data import data
from grouser.cli.train import train
from grouser.native import cpu_level
from grouser.surrogate import Surrogate, shipped_names
from grouser.surrogate.offline import DataConfig, TrainingConfig
from grouser.terrain import ArtifactError, backend_names

VERBS = (
    "demo", "data", "train", "evaluate", "compare", "drive", "doctor",
    "rl train", "rl eval", "rl video", "rl record", "rl tune", "rl recipes",
    "list vehicles", "list terrains", "list backends", "list paths",
)  # fmt: skip
BARE = """
import sys
for name in ("torch", "casadi", "pyarrow", "joblib", "stable_baselines3", "pygame", "matplotlib", "PIL"):
    sys.modules[name] = None
from grouser.cli import main
main()
"""


def test_doctor_names_what_is_there(call: Any) -> None:
    out = call("doctor").out
    for expected in (version("grouser"), version("numpy"), version("torch"), cpu_level(), *backend_names()):
        assert expected in out
    assert "grouser/PathTracking-v0" in out
    assert "ipopt" in out
    for name in shipped_names():
        assert name in out
        assert Surrogate.load(name).content_hash[:12] in out


def test_doctor_says_how_to_get_what_is_missing(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def installed(name: str) -> str:
        if name in ("casadi", "torch"):
            raise PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr("grouser.cli.doctor.version", installed)
    monkeypatch.setitem(sys.modules, "casadi", None)
    out = call("doctor").out
    assert "pip install 'grouser[torch]'" in out
    assert "pip install 'grouser[mpc]'" in out
    assert "none: CasADi is missing" in out


def test_doctor_survives_a_damaged_artifact(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def damaged(path: str) -> Surrogate:
        raise ArtifactError(f"{path}: altered")

    monkeypatch.setattr("grouser.surrogate.shipped_names", lambda: ("m113-rigid",))
    monkeypatch.setattr(Surrogate, "load", damaged)
    assert "altered" in call("doctor").out


@pytest.mark.parametrize("arguments", [["--help"], ["doctor"], ["train", "--help"], ["--version"]])
def test_runs_without_any_optional_package(arguments: list[str]) -> None:
    done = subprocess.run([sys.executable, "-P", "-c", BARE, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


def test_a_missing_package_is_named() -> None:
    arguments = ["drive", "--backend", "physics"]
    done = subprocess.run([sys.executable, "-P", "-c", BARE, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines() == ["error: this needs the package 'casadi': pip install 'grouser[mpc]'"]


@pytest.mark.parametrize("verb", VERBS)
def test_help_teaches(call: Any, verb: str) -> None:
    out = call(*verb.split(), "--help").out
    assert f"Example: grouser {verb}" in " ".join(out.split())
    assert len(out.split("Options")[0]) > 200


def test_no_arguments_show_help(call: Any) -> None:
    assert "grouser demo" in " ".join(call(code=2).out.split())


def test_version(call: Any) -> None:
    assert call("--version").out == f"grouser {version('grouser')}\n"


@pytest.mark.parametrize(
    ("verb", "config", "renamed"), [(data, DataConfig, {"samples_per_run": "samples"}), (train, TrainingConfig, {})]
)
def test_defaults_are_those_of_the_library(verb: Any, config: Any, renamed: dict[str, str]) -> None:
    parameters = inspect.signature(verb).parameters
    for field in fields(config):
        got, expected = parameters[renamed.get(field.name, field.name)].default, field.default
        if isinstance(expected, tuple):
            got = tuple(float(part) for part in got.split(","))
        assert got == expected, field.name
