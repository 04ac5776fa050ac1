"""Early stopping and plateaus, epoch by epoch, and checkpoints that bring back everything or are refused."""

import json
import math
import pickle
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors import safe_open
from safetensors.numpy import save

from grouser.surrogate.container import pack, unpack
from grouser.surrogate.offline.checkpoint import TrainingState, load_checkpoint, save_checkpoint
from grouser.terrain import ArtifactError

IDENTITY = {"config": {"hidden": [3], "seed": 0}, "dataset": "ab" * 32}


def module(seed: int = 0) -> torch.nn.Sequential:
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return torch.nn.Sequential(torch.nn.Linear(2, 3), torch.nn.SiLU(), torch.nn.Linear(3, 1))


def adam(net: torch.nn.Module) -> torch.optim.Adam:
    return torch.optim.Adam(net.parameters(), lr=1e-2, weight_decay=1e-3)


def step(net: torch.nn.Module, optimizer: torch.optim.Optimizer, count: int) -> None:
    x = torch.linspace(-1, 1, 8).reshape(4, 2)
    for index in range(count):
        optimizer.zero_grad()
        ((net(x) - index) ** 2).mean().backward()
        optimizer.step()


def follow(losses: list[float], **changes: Any) -> list[TrainingState]:
    options = {"plateau_patience": 2, "plateau_factor": 0.5, "decay": 1.0} | changes
    states, net = [TrainingState(rate=1.0)], module()
    for loss in losses:
        states.append(states[-1].after(loss, net, **options))
    return states


# --- the state between two epochs


def test_an_improvement_resets_both_counters() -> None:
    states = follow([3.0, 4.0, 2.0])
    assert [state.epoch for state in states] == [0, 1, 2, 3]
    assert [state.stale for state in states] == [0, 0, 1, 0]
    assert [state.flat for state in states] == [0, 0, 1, 0]
    assert [state.best_loss for state in states] == [math.inf, 3.0, 3.0, 2.0]
    assert {state.rate for state in states} == {1.0}


def test_the_rate_falls_after_the_plateau_and_waits_for_the_next() -> None:
    states = follow([1.0, *[2.0] * 6])
    assert [state.rate for state in states[1:]] == [1.0, 1.0, 0.5, 0.5, 0.25, 0.25, 0.125]
    assert [state.flat for state in states[1:]] == [0, 1, 0, 1, 0, 1, 0]
    assert [state.stale for state in states[1:]] == [0, 1, 2, 3, 4, 5, 6]  # early stopping counts on


def test_an_equal_loss_is_no_improvement() -> None:
    assert follow([1.0, 1.0])[-1].stale == 1


def test_the_rate_decays_every_epoch_improved_or_not() -> None:
    states = follow([3.0, 2.0, 4.0, 4.0, 1.0], decay=0.8)
    assert [state.rate for state in states] == pytest.approx([1, 0.8, 0.64, 0.512, 0.5 * 0.4096, 0.5 * 0.32768])


def test_the_best_parameters_are_copies_of_that_epochs() -> None:
    net = module()
    options = {"plateau_patience": 9, "plateau_factor": 0.5, "decay": 1.0}
    best = {name: value.clone() for name, value in net.state_dict().items()}
    state = TrainingState(rate=1.0).after(1.0, net, **options)  # type: ignore[arg-type]
    step(net, adam(net), 3)
    state = state.after(2.0, net, **options)  # type: ignore[arg-type]
    assert set(state.best_parameters) == set(best)
    for name, value in best.items():
        assert torch.equal(state.best_parameters[name], value)
        assert not torch.equal(net.state_dict()[name], value)


@pytest.mark.parametrize("loss", [math.nan, math.inf])
def test_a_first_epoch_that_diverges_is_an_error(loss: float) -> None:
    with pytest.raises(ArtifactError, match="learning_rate"):
        follow([loss])


def test_a_later_epoch_that_diverges_is_only_no_improvement() -> None:
    state = follow([1.0, math.nan, math.inf])[-1]
    assert (state.stale, state.best_loss) == (2, 1.0)


# --- the file


@pytest.fixture
def saved(tmp_path: Path) -> tuple[Path, TrainingState, torch.nn.Sequential, torch.optim.Adam]:
    net = module()
    optimizer = adam(net)
    best = {name: value.clone() for name, value in net.state_dict().items()}
    step(net, optimizer, 3)
    state = TrainingState(rate=0.1 + 0.2, epoch=7, stale=2, flat=1, best_loss=1 / 3, best_parameters=best)
    path = tmp_path / "folder" / "net.checkpoint"
    save_checkpoint(path, state, net, optimizer, IDENTITY)
    return path, state, net, optimizer


Saved = tuple[Path, TrainingState, torch.nn.Sequential, torch.optim.Adam]


def load(path: Path, identity: dict[str, Any] | None = None) -> TrainingState | None:
    net = module(1)
    return load_checkpoint(path, net, adam(net), identity or IDENTITY)


def test_no_file_is_no_state(tmp_path: Path) -> None:
    assert load(tmp_path / "net.checkpoint") is None


def test_only_the_file_itself_is_left(saved: Saved) -> None:
    assert [path.name for path in saved[0].parent.iterdir()] == ["net.checkpoint"]


def test_everything_comes_back_bit_by_bit(saved: Saved) -> None:
    path, state, net, optimizer = saved
    other = module(1)
    other_optimizer = adam(other)
    loaded = load_checkpoint(path, other, other_optimizer, IDENTITY)
    assert loaded is not None
    for name in ("rate", "epoch", "stale", "flat", "best_loss"):
        assert getattr(loaded, name) == getattr(state, name)
    assert set(loaded.best_parameters) == set(state.best_parameters)
    for name, value in state.best_parameters.items():
        assert torch.equal(loaded.best_parameters[name], value)
    step(net, optimizer, 4)
    step(other, other_optimizer, 4)
    for mine, theirs in zip(net.parameters(), other.parameters(), strict=True):
        assert torch.equal(mine, theirs)


def test_a_checkpoint_is_no_pickle(saved: Saved) -> None:
    with safe_open(saved[0], framework="np") as file:
        assert json.loads(file.metadata()["grouser"])["progress"]["epoch"] == 7


def test_a_failing_write_leaves_the_last_checkpoint(saved: Saved, monkeypatch: pytest.MonkeyPatch) -> None:
    path, state, net, optimizer = saved

    whole = Path.write_bytes

    def failing(target: Path, data: bytes) -> int:
        whole(target, data[: len(data) // 2])
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", failing)
        with pytest.raises(OSError, match="No space"):
            save_checkpoint(path, state, net, optimizer, IDENTITY)
    loaded = load(path)
    assert loaded is not None
    assert loaded.epoch == 7
    save_checkpoint(path, state, net, optimizer, IDENTITY)
    assert [entry.name for entry in path.parent.iterdir()] == ["net.checkpoint"]


@pytest.mark.parametrize(
    "identity",
    [
        {**IDENTITY, "dataset": "cd" * 32},
        {**IDENTITY, "config": {"hidden": [3], "seed": 1}},
        {"config": IDENTITY["config"]},
    ],
    ids=["dataset", "recipe", "nothing"],
)
def test_a_checkpoint_of_another_training_is_refused(saved: Saved, identity: dict[str, Any]) -> None:
    with pytest.raises(ArtifactError, match="another dataset or recipe; remove it"):
        load(saved[0], identity)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.99])
def test_a_truncated_checkpoint_is_refused(saved: Saved, share: float) -> None:
    content = saved[0].read_bytes()
    saved[0].write_bytes(content[: int(share * len(content))])
    with pytest.raises(ArtifactError, match=r"not a training checkpoint; remove it"):
        load(saved[0])


@pytest.mark.parametrize("place", ["first tensor", "last byte"])
def test_a_checkpoint_with_a_flipped_bit_is_refused(saved: Saved, place: str) -> None:
    content = bytearray(saved[0].read_bytes())
    header = int.from_bytes(content[:8], "little")
    content[8 + header + 2 if place == "first tensor" else -1] ^= 0x10
    saved[0].write_bytes(content)
    with pytest.raises(ArtifactError, match="remove it"):
        load(saved[0])


def test_another_file_is_refused_and_a_pickle_not_run(saved: Saved) -> None:
    saved[0].write_bytes(b"not a checkpoint, whatever its name says")
    with pytest.raises(ArtifactError, match="remove it"):
        load(saved[0])
    saved[0].write_bytes(pickle.dumps(pytest.fail))
    with pytest.raises(ArtifactError, match="remove it"):
        load(saved[0])


@pytest.mark.parametrize(
    "metadata",
    [
        None,
        {},
        {"progress": {}},
        {"progress": {"colour": 1}},
        {"progress": []},
    ],
    ids=str,
)
def test_metadata_that_says_nothing_is_refused(saved: Saved, metadata: dict[str, Any] | None) -> None:
    tensors, known = unpack(saved[0].read_bytes(), "saved", 1)
    identity = {"format_version": known["format_version"], "identity": known["identity"]}
    saved[0].write_bytes(save(tensors) if metadata is None else pack(tensors, identity | metadata))
    with pytest.raises(ArtifactError, match="remove it"):
        load(saved[0])
