"""``grouser bench``: what is printed, the folder, and once everything for real."""

import json
from pathlib import Path
from typing import Any

import pytest
from bench_document import bench_document

from grouser.controllers import bench as package


def test_it_prints_the_targets_and_writes_both_folders(
    call: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    asked: dict[str, Any] = {}

    def canned(vehicle: Any, config: Any, **options: Any) -> dict[str, Any]:
        asked.update(options, vehicle=vehicle.name, config=config)
        return bench_document()

    monkeypatch.setattr(package, "run_bench", canned)
    monkeypatch.chdir(tmp_path)
    called = call("bench", "--quick", "--output", "made", "--docs", "docs")
    assert asked["command"] == "grouser bench --output made --docs docs --quick"
    assert asked["config"] == package.BenchConfig.quick()
    assert asked["vehicle"] == "m113"
    assert "against our own SIMD physics" in called.out
    assert "not measured, torch  torch is not installed" in called.out
    assert {"bench.json", "bench.md"} <= {file.name for file in (tmp_path / "made").iterdir()}
    assert (tmp_path / "docs" / "bench.md").exists()


def test_folders_elsewhere_are_not_written_down(call: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}
    monkeypatch.setattr(package, "run_bench", lambda *_, **options: asked.update(options) or bench_document())
    call("bench", "--output", tmp_path)
    assert asked["command"] == "grouser bench"


@pytest.mark.slow
def test_everything_runs(call: Any, tmp_path: Path) -> None:
    called = call("bench", "--quick", "--output", tmp_path)
    document = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))
    assert {"networks_c", "physics_c", "python", "batch", "latency", "environments", "fleets"} <= set(document["times"])
    for section in document["times"].values():
        assert section["figures"]
        assert all(value >= 0 for values in section["figures"].values() for value in values.values())
    assert len(document["targets"]) == len(package.TARGETS)
    assert "targets  " in called.out
