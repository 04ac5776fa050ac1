"""``grouser validate``: the table, the folder, the exit code."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from grouser.terrain.validation import STUDIES, run_checks

REPORT = "grouser.terrain.validation.report"


@pytest.fixture(scope="module")
def made(call: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    folder = tmp_path_factory.mktemp("validate") / "new"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(f"{REPORT}.STUDIES", STUDIES[:2])  # every figure is drawn once, in the tests of the studies
        return folder, call("validate", "--quick", "--output", folder)


def test_it_prints_the_checks_and_writes_the_folder(made: tuple[Path, Any]) -> None:
    folder, called = made
    document = json.loads((folder / "validation.json").read_text(encoding="utf-8"))
    count = len(document["checks"])
    assert f"checks  {count} of {count} within tolerance" in called.out
    assert "golden state" in called.out
    assert str(folder / "index.md") in called.out
    for stage in ("checks", "studies", "figures"):
        assert f"{stage}: " in called.err
    assert set(document) == {"meta", "vehicle", "checks", "studies"}
    assert set(document["meta"]) == {"command", "grouser", "machine"}
    assert document["meta"]["command"].startswith("grouser validate --output")
    assert all((folder / f"{name}.png").exists() for name in document["studies"])


def test_a_failing_check_leaves_with_one(call: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def two_checks(vehicle: Any, **options: Any) -> list[Any]:
        (first, *_) = run_checks(vehicle, blocks=[], quick=True)
        return [first, replace(first, measured=first.measured + 1)]

    monkeypatch.setattr(f"{REPORT}.run_checks", two_checks)
    monkeypatch.setattr(f"{REPORT}.STUDIES", ())
    called = call("validate", "--quick", "--output", tmp_path, code=1)
    assert "checks  1 of 2 within tolerance" in called.out
    assert "not within tolerance" in (tmp_path / "index.md").read_text(encoding="utf-8")


def test_a_vehicle_with_gaps_is_refused_in_one_line(call: Any, tmp_path: Path) -> None:
    called = call("validate", "--vehicle", "warthog", "--quick", "--output", tmp_path, code=2)
    assert "gaps" in called.err
    assert not list(tmp_path.iterdir())
