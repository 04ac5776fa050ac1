"""The folder of a training: what its files are called, whose it is, and the curve in it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, Final

from ...terrain import ArtifactError, ConfigurationError, write_aside, write_json
from .plan import TrainingPlan

RUN: Final = "run.json"
CHECKPOINT: Final = "checkpoint.safetensors"
CURVE: Final = "evaluations.jsonl"
POLICY: Final = "policy.safetensors"
BEST: Final = "best.safetensors"
POLICIES: Final = "policies"
BOARD: Final = "tensorboard"


def identity_of(plan: TrainingPlan, facts: Mapping[str, Any]) -> dict[str, Any]:
    """Return what two trainings have to share for one to go on where the other stopped, as JSON holds it."""
    content = {
        "recipe": plan.recipe.to_json(),
        "environment": dict(facts),
        "seed": plan.seed,
        "checkpoint_every": plan.checkpoint_every,
        "eval_every": plan.eval_every,
        "eval_episodes": plan.eval_episodes,
        "eval_environment": plan.judging.facts() if plan.eval_every else None,
    }
    return dict(json.loads(json.dumps(content)))


def claim(folder: FilePath, identity: Mapping[str, Any], *, resume: bool) -> None:
    """Write the training's identity into its folder, or see that it is the one that is there.

    Raises
    ------
    ConfigurationError
        If the folder holds a training that is not to be resumed, or another one, or none to resume.
    ArtifactError
        If its identity is damaged.
    """
    file = folder / RUN
    if not file.exists():
        if resume:
            raise ConfigurationError(f"{folder} holds no training to resume")
        write_json(file, identity)
        return
    if not resume:
        raise ConfigurationError(f"{folder} holds a training: resume it, or choose another folder")
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ArtifactError(f"{file} is damaged: {error}") from error
    differing = list(_differences(found, identity))
    if differing:
        raise ConfigurationError(f"{folder} holds another training: {'; '.join(differing)}")


def write_curve(folder: FilePath, curve: Sequence[Mapping[str, Any]]) -> None:
    """Write the evaluations of a training, one a line."""
    write_aside(folder / CURVE, "".join(f"{json.dumps(entry, sort_keys=True)}\n" for entry in curve).encode())


def read_curve(folder: FilePath) -> list[dict[str, Any]]:
    """Return the evaluations of a training, in their order; none where there is no curve.

    Raises
    ------
    ArtifactError
        If the file is damaged.
    """
    file = folder / CURVE
    if not file.exists():
        return []
    try:
        return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    except ValueError as error:
        raise ArtifactError(f"{file} is damaged: {error}") from error


def _differences(there: Any, asked: Any, name: str = "") -> Iterator[str]:
    if isinstance(there, dict) and isinstance(asked, dict):
        for key in sorted(there.keys() | asked.keys()):
            yield from _differences(there.get(key), asked.get(key), f"{name}.{key}" if name else key)
    elif there != asked:
        yield f"{name} {json.dumps(there)} there, {json.dumps(asked)} asked"
