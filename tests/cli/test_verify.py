"""What is verified passes; what was tampered with leaves with 1; what is neither is one line."""

import errno
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from grouser.surrogate import Surrogate


def test_a_dataset_passes_and_its_findings_are_written(call: Any, dataset: Path, tmp_path: Path) -> None:
    file = tmp_path / "new" / "findings.json"
    out = call("verify", dataset, "--json", file).out
    written = json.loads(file.read_text())
    assert written["passed"]
    assert written["target"] == str(dataset)
    assert all(finding["passed"] for finding in written["findings"])
    assert f"{len(written['findings'])} of {len(written['findings'])} passed" in out
    assert "run on two sides" in out


def test_a_tampered_dataset_leaves_with_one(call: Any, dataset: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(dataset, tmp_path / "copy"))
    content = json.loads((copy / "dataset.json").read_text())
    (copy / "dataset.json").write_text(json.dumps(content | {"seed": 4}))
    file = tmp_path / "findings.json"
    called = call("verify", copy, "--json", file, code=1)
    written = json.loads(file.read_text())
    failed = {finding["check"] for finding in written["findings"] if not finding["passed"]}
    assert failed == {"content hash", "terrain and excitation drawn from the seed"}
    assert not written["passed"]
    assert called.err == ""
    assert f"{len(written['findings']) - 2} of {len(written['findings'])} passed" in called.out


def test_what_training_refuses_says_what_to_call(call: Any, dataset: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(dataset, tmp_path / "copy"))
    content = json.loads((copy / "dataset.json").read_text())
    (copy / "dataset.json").write_text(json.dumps(content | {"seed": 4}))
    assert "'grouser verify' says where" in call("train", copy, tmp_path / "x.safetensors", code=2).err


def test_an_artifact_with_its_dataset_and_a_baseline(call: Any, dataset: Path, artifact: Path, tmp_path: Path) -> None:
    baseline = tmp_path / "baseline.json"
    out = call("verify", artifact, "--dataset", dataset, "--write-baseline", baseline).out
    assert "stored test metrics" in out
    assert "told" in out
    assert "since the baseline" in " ".join(call("verify", artifact, "--baseline", baseline).out.split())
    content = json.loads(baseline.read_text())
    content["judgement"]["metrics"]["mz"]["rmse"] /= 2
    baseline.write_text(json.dumps(content))
    kept = tmp_path / "kept.json"
    called = call("verify", artifact, "--baseline", baseline, "--write-baseline", kept, code=1)
    assert "rise of the RMSE since the baseline" in " ".join(called.out.split())
    assert not kept.exists()


def test_a_shipped_artifact_is_verified_by_its_name(call: Any) -> None:
    assert "sizes and parts fit together" in call("verify", "m113-rigid").out


def test_a_truncated_artifact_leaves_with_one(call: Any, artifact: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.safetensors"
    cut.write_bytes(artifact.read_bytes()[:-100])
    assert "truncated" in call("verify", cut, code=1).out


def test_what_is_neither_is_one_helpful_line(call: Any, dataset: Path, artifact: Path, tmp_path: Path) -> None:
    (tmp_path / "unfinished" / "parts").mkdir(parents=True)
    (tmp_path / "notes.txt").write_text("")
    for target, expected in (
        (tmp_path / "nowhere", "no such file or folder"),
        (tmp_path, "a folder without dataset.json"),
        (tmp_path / "notes.txt", "does not end in .safetensors"),
        (tmp_path / "unfinished", "unfinished dataset"),
        (dataset / "dataset.json", "does not end in .safetensors"),
    ):
        called = call("verify", target, code=2)
        (line,) = called.err.splitlines()
        assert line.startswith("error: ")
        assert expected in line
    assert "go with an artifact" in call("verify", dataset, "--dataset", dataset, code=2).err
    assert "cannot read baseline" in call("verify", artifact, "--baseline", tmp_path / "none.json", code=2).err


@pytest.mark.parametrize(
    ("arguments", "failing", "kept"),
    [
        (["data", "x"], "grouser.surrogate.offline.generate_dataset", "finished runs are kept"),
        (["train", "x", "y.safetensors"], "grouser.surrogate.offline.load_dataset", "finished epochs are kept"),
    ],
)
def test_a_full_disk_is_one_line_that_says_what_is_kept(
    call: Any, arguments: list[str], failing: str, kept: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full_disk(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(failing, full_disk)
    (line,) = call(*arguments, code=2).err.splitlines()
    assert line.startswith("error: the disk is full")
    assert kept in line


def test_the_baseline_is_of_the_artifact_that_was_named(call: Any, artifact: Path, tmp_path: Path) -> None:
    baseline = tmp_path / "baseline.json"
    call("verify", artifact, "--write-baseline", baseline)
    content, surrogate = json.loads(baseline.read_text()), Surrogate.load(artifact)
    assert content["judgement"]["artifact"] == surrogate.content_hash
    assert content["judgement"]["runs"] == surrogate.recipe["split"]["test"]
    assert content["judgement"]["metrics"]["qx"]["rmse"] == surrogate.metrics["test"]["qx"]["rmse"]
