"""Datasets and artifacts are verified before use: every finding on one of them."""

from __future__ import annotations

import os

from ...terrain import InvalidInputError
from ..artifact import Surrogate
from .artifact_verification import read_artifact, verify_behaviour
from .dataset import Dataset
from .dataset_verification import verify_dataset
from .finding import Finding, refused
from .metrics_verification import (
    Baseline,
    Judgement,
    compare_with_baseline,
    judge_artifact,
    read_baseline,
    stored_judgement,
    verify_metrics,
    write_baseline,
)

__all__ = [
    "Baseline",
    "Finding",
    "Judgement",
    "judgement_of",
    "read_baseline",
    "verify_artifact",
    "verify_dataset",
    "write_baseline",
]


def verify_artifact(
    artifact: str | os.PathLike[str], *, dataset: Dataset | None = None, baseline: Baseline | None = None
) -> list[Finding]:
    """Return the findings on an artifact; one that holds no surrogate has those on its file alone.

    Parameters
    ----------
    artifact : str or path-like
        File, or one of :func:`grouser.surrogate.shipped_names`.
    dataset : Dataset, optional
        What it was trained on: its test metrics are computed again.
    baseline : Baseline, optional
        Metrics that must not have got worse: those on the dataset, or else those that the artifact holds.

    Raises
    ------
    ArtifactError
        If the dataset is of another vehicle or mode, or there are no metrics to compare with the baseline.
    ConfigurationError
        If torch is not installed.
    """
    findings, surrogate = read_artifact(artifact)
    if surrogate is None:
        return findings
    try:
        findings += verify_behaviour(surrogate)
    except InvalidInputError as error:
        findings.append(refused("evaluated inside its box", "network", error))
    if dataset is not None:
        findings += verify_metrics(surrogate, dataset)
    if baseline is not None:
        findings += compare_with_baseline(judgement_of(surrogate, dataset), baseline)
    return findings


def judgement_of(surrogate: Surrogate, dataset: Dataset | None = None) -> Judgement:
    """Return a surrogate's metrics on a dataset, or those that its artifact holds.

    Raises
    ------
    ArtifactError
        If the dataset is of another vehicle or mode, or the artifact does not hold what is needed.
    """
    return stored_judgement(surrogate) if dataset is None else judge_artifact(surrogate, dataset)
