"""From nothing to a judged surrogate."""

import json
from pathlib import Path
from typing import Any

import pytest

from grouser.surrogate import Surrogate
from grouser.surrogate.offline.dataset import load_dataset, read_manifest


def test_data_prints_the_content_hash_and_is_used_again(call: Any, dataset: Path) -> None:
    manifest = read_manifest(dataset)
    written = (dataset / "samples.parquet").stat().st_mtime_ns
    again = call("data", dataset, "--runs", 18, "--samples", 60, "--transient", 0.5, "--seed", 3, "--workers", 1)
    assert manifest.content_hash in again.out
    assert (dataset / "samples.parquet").stat().st_mtime_ns == written


def test_data_refuses_a_folder_of_another_recipe(call: Any, dataset: Path) -> None:
    refused = call("data", dataset, "--runs", 19, code=2)
    assert "another dataset" in refused.err


def test_data_options_reach_the_manifest(call: Any, tmp_path: Path) -> None:
    folder = tmp_path / "soil"
    options = ["--mode", "soil", "--vehicle", "ugv", "--ranges", "paper", "--runs", 2, "--samples", 10]
    called = call(
        "data", folder, *options, "--transient", 0.2, "--tick", 0.02, "--integrator", "sdirk2", "--seed", 5,
        "--workers", 1,
    )  # fmt: skip
    manifest = read_manifest(folder)
    assert (manifest.mode, manifest.vehicle["name"], manifest.ranges) == ("soil", "ugv", "paper")
    assert (manifest.runs, manifest.samples_per_run, manifest.transient) == (2, 10, 0.2)
    assert (manifest.tick, manifest.integrator, manifest.seed) == (0.02, "sdirk2", 5)
    assert "runs: 2/2" in called.err


def test_train_keeps_its_recipe(call: Any, dataset: Path, tmp_path: Path) -> None:
    file = tmp_path / "made.safetensors"
    called = call(
        "train", dataset, file, "--hidden", "8", "--activation", "tanh", "--epochs", 2, "--batch-size", 128,
        "--learning-rate-decay", 0.9, "--perturbed-copies", 0, "--no-symmetries", "--no-whiten", "--dropout", 0.1,
        "--weight-decay", 1e-4, "--output-weights", "1,2,4", "--seed", 7,
    )  # fmt: skip
    surrogate = Surrogate.load(file)
    recipe = surrogate.recipe
    assert (recipe["hidden"], recipe["activation"], recipe["epochs"]) == ([8], "tanh", 2)
    assert (recipe["learning_rate_decay"], recipe["perturbed_copies"], recipe["symmetries"]) == (0.9, 0, False)
    assert (recipe["whiten"], recipe["dropout"], recipe["weight_decay"]) == (False, 0.1, 1e-4)
    assert (recipe["output_weights"], recipe["seed"]) == ([1.0, 2.0, 4.0], 7)
    assert surrogate.content_hash in called.out
    assert "epochs: 1/2 loss" in called.err
    assert "epochs: 2/2 loss" in called.err


def test_evaluate_uses_the_artifacts_own_test_runs(call: Any, dataset: Path, artifact: Path, tmp_path: Path) -> None:
    file = tmp_path / "new" / "figures.json"
    out = call("evaluate", artifact, dataset, "--json", file).out
    figures, surrogate = json.loads(file.read_text()), Surrogate.load(artifact)
    assert figures["runs"] == surrogate.recipe["split"]["test"]
    assert figures["split"] == "its own test runs"
    for output, values in surrogate.metrics["test"].items():
        assert figures["metrics"][output] == pytest.approx(values)
    errors = [run["mz_rmse"] for run in figures["worst_runs"]]
    assert len(errors) == 3
    assert errors == sorted(errors, reverse=True)
    assert {run["run"] for run in figures["worst_runs"]} <= set(figures["runs"])
    assert "its own test runs" in out
    assert f"{surrogate.metrics['test']['mz']['r2']:.5f}" in out


def test_evaluate_on_all_runs_says_so(call: Any, dataset: Path, artifact: Path, tmp_path: Path) -> None:
    file = tmp_path / "figures.json"
    out = call("evaluate", artifact, dataset, "--split", "all", "--worst", 1, "--json", file).out
    figures = json.loads(file.read_text())
    assert figures["runs"] == list(range(18))
    assert len(figures["worst_runs"]) == 1
    assert "training runs included" in " ".join(out.split())


def test_evaluate_on_another_dataset_takes_every_run(call: Any, artifact: Path, tmp_path: Path) -> None:
    other, file = tmp_path / "other", tmp_path / "figures.json"
    call("data", other, "--runs", 6, "--samples", 20, "--transient", 0.5, "--seed", 9, "--workers", 1)
    assert "that it was not trained on" in call("evaluate", artifact, other, "--json", file).out
    assert json.loads(file.read_text())["runs"] == [record.run for record in load_dataset(other).records]


def test_evaluate_refuses_another_mode(call: Any, artifact: Path, tmp_path: Path) -> None:
    other = tmp_path / "soil"
    call("data", other, "--mode", "soil", "--runs", 1, "--samples", 5, "--transient", 0, "--workers", 1)
    assert "asked for m113 on soil ground" in call("evaluate", artifact, other, code=2).err


def test_train_writes_a_model_card_and_learning_curves(call: Any, dataset: Path, tmp_path: Path) -> None:
    file, board = tmp_path / "made.safetensors", tmp_path / "board"
    called = call(
        "train", dataset, file, "--family", "structured", "--hidden", "4", "--schedule", "cosine", "--epochs", 2,
        "--perturbed-copies", 0, "--no-symmetries", "--tensorboard", board,
    )  # fmt: skip
    surrogate = Surrogate.load(file)
    assert surrogate.structured
    assert surrogate.recipe["schedule"] == "cosine"
    card = file.with_suffix(".md")
    assert str(card) in called.out
    assert surrogate.content_hash in card.read_text(encoding="utf-8")
    assert len(list(board.glob("events.out.tfevents.*"))) == 1


def test_a_preset_is_a_whole_recipe(call: Any) -> None:
    refused = call("train", "--preset", "m113-rigid", "--epochs", 3, "--hidden", "8", code=2)
    assert "leave out --epochs, --hidden" in refused.err
    assert "did you mean 'm113-rigid'" in call("train", "--preset", "m113-rigit", code=2).err


def test_train_needs_a_dataset_and_an_output_or_a_preset(call: Any, dataset: Path) -> None:
    for arguments in ([], [dataset]):
        assert "or --preset NAME" in call("train", *arguments, code=2).err
