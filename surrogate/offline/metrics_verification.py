"""Whether a surrogate is as good as its artifact says, and no worse than a baseline that was kept."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from ...terrain import OUTPUT_NAMES, ArtifactError, write_json
from ..artifact import Surrogate
from .dataset import Dataset
from .finding import Finding, counted
from .metrics import force_metrics, metrics_to_dict
from .split import RunSplit
from .split_verification import verify_split

#: Largest difference of a recomputed metric, R² as it is and errors as a share of the RMSE.
METRIC_LIMIT: Final = 1e-6
BASELINE_VERSION: Final = 1


@dataclass(frozen=True)
class Judgement:
    """How good a surrogate is, and on what.

    Parameters
    ----------
    artifact : str
        Content hash of the surrogate.
    dataset : str
        Content hash of the dataset.
    runs : tuple of int
        Runs of it.
    metrics : mapping of str to mapping
        ``r2``, None where the output does not vary, and ``rmse`` in N and N m, by output.
    """

    artifact: str
    dataset: str
    runs: tuple[int, ...]
    metrics: Mapping[str, Mapping[str, float | None]]


@dataclass(frozen=True)
class Baseline:
    """A judgement that was kept, with how much worse a later one may be.

    Parameters
    ----------
    judgement : Judgement
        What was measured.
    r2_fall : float
        Largest fall of R².
    rmse_rise : float
        Largest rise of the RMSE, as a share of it.
    """

    judgement: Judgement
    r2_fall: float = 1e-3
    rmse_rise: float = 0.05


def stored_judgement(surrogate: Surrogate) -> Judgement:
    """Return the test metrics that an artifact holds.

    Raises
    ------
    ArtifactError
        If it does not hold them, or not the runs that they are of.
    """
    split, test = _stored_split(surrogate), surrogate.metrics.get("test")
    try:
        return _judgement(surrogate, surrogate.dataset_hash, split.test, dict(test or {}))
    except (KeyError, TypeError, ValueError) as error:
        raise ArtifactError(f"the artifact holds no test metrics: {error}") from error


def judge_artifact(surrogate: Surrogate, dataset: Dataset) -> Judgement:
    """Return a surrogate's metrics on its own test runs, or on all runs of a dataset that it was not trained on.

    Raises
    ------
    ArtifactError
        If the dataset is of another vehicle or mode, or the artifact does not hold its test runs.
    """
    surrogate.require(dataset.vehicle, dataset.manifest.mode)
    own = surrogate.dataset_hash == dataset.manifest.content_hash
    runs = _stored_split(surrogate).test if own else tuple(record.run for record in dataset.records)
    return _judgement(surrogate, dataset.manifest.content_hash, runs, _recomputed(surrogate, dataset.select(runs)))


def verify_metrics(surrogate: Surrogate, dataset: Dataset) -> list[Finding]:
    """Return whether a dataset is what a surrogate was trained on, without leaks, and gives its test metrics again.

    Raises
    ------
    ArtifactError
        If the dataset is of another vehicle or mode.
    """
    surrogate.require(dataset.vehicle, dataset.manifest.mode)
    found, expected = dataset.manifest.content_hash, surrogate.dataset_hash
    other = [] if found == expected else [f"{found[:12]}, it was trained on {expected[:12] or 'none that is named'}"]
    trained_on = counted("dataset of the artifact", "dataset", other, "hashes")
    if not trained_on.passed:
        return [trained_on]
    try:
        split, stored = _stored_split(surrogate), surrogate.metrics["test"]
        findings = verify_split(dataset, split, "split of the artifact")
        recomputed = _recomputed(surrogate, dataset.select(split.test))
        findings += [
            Finding(
                "stored test metrics", name, _difference(stored[name], recomputed[name]), METRIC_LIMIT, "of the RMSE"
            )
            for name in OUTPUT_NAMES
        ]
    except (ArtifactError, KeyError, TypeError) as error:
        return [trained_on, counted("stored test metrics", "artifact", [f"not held: {error}"], "artifacts")]
    return [trained_on, *findings]


def compare_with_baseline(judgement: Judgement, baseline: Baseline) -> list[Finding]:
    """Return whether a judgement on the same runs is no worse than a baseline, output by output."""
    before = baseline.judgement
    different = []
    if judgement.dataset != before.dataset:
        different.append(f"dataset {judgement.dataset[:12]}, the baseline has {before.dataset[:12]}")
    elif judgement.runs != before.runs:
        different.append("other runs of it")
    comparable = counted("same runs as the baseline", "dataset", different, "datasets")
    if not comparable.passed:
        return [comparable]
    findings = [comparable]
    for name in OUTPUT_NAMES:
        now, then = judgement.metrics[name], before.metrics[name]
        if then["r2"] is not None:
            fall = math.nan if now["r2"] is None else then["r2"] - now["r2"]
            findings.append(Finding("fall of R² since the baseline", name, fall, baseline.r2_fall, "1"))
        rise = _ratio(now["rmse"], then["rmse"]) - 1
        findings.append(Finding("rise of the RMSE since the baseline", name, rise, baseline.rmse_rise, "of it"))
    return findings


def write_baseline(path: Path, baseline: Baseline) -> Path:
    """Write a baseline as JSON, aside and renamed; return the path."""
    return write_json(path, {"format_version": BASELINE_VERSION, **asdict(baseline)})


def read_baseline(path: Path) -> Baseline:
    """Read a baseline.

    Raises
    ------
    ArtifactError
        If there is none, or it is not one.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["format_version"] != BASELINE_VERSION:
            raise ValueError(f"format {content['format_version']!r}, this version reads {BASELINE_VERSION}")
        judged = content["judgement"]
        metrics = {
            name: {key: _optional(judged["metrics"][name][key]) for key in ("r2", "rmse")} for name in OUTPUT_NAMES
        }
        judgement = Judgement(str(judged["artifact"]), str(judged["dataset"]), tuple(judged["runs"]), metrics)
        return Baseline(judgement, float(content["r2_fall"]), float(content["rmse_rise"]))
    except OSError as error:
        raise ArtifactError(f"cannot read baseline {str(path)!r}: {error.strerror}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ArtifactError(f"{path} is not a baseline; make one: grouser verify --write-baseline ({error})") from error


def _stored_split(surrogate: Surrogate) -> RunSplit:
    try:
        sides = surrogate.recipe["split"]
        return RunSplit(**{side: tuple(int(run) for run in runs) for side, runs in sides.items()})
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ArtifactError("the artifact does not say which runs it was trained and tested on") from error


def _judgement(surrogate: Surrogate, dataset: str, runs: tuple[int, ...], metrics: Mapping[str, Any]) -> Judgement:
    kept = {name: {key: _optional(metrics[name][key]) for key in ("r2", "rmse")} for name in OUTPUT_NAMES}
    return Judgement(surrogate.content_hash, dataset, runs, kept)


def _recomputed(surrogate: Surrogate, chosen: Dataset) -> dict[str, dict[str, Any]]:
    if not len(chosen.inputs):
        raise ArtifactError("the dataset has none of the runs that the artifact was tested on")
    return metrics_to_dict(force_metrics(surrogate.reference_forces(chosen.inputs), chosen.forces))


def _difference(stored: Mapping[str, float | None], found: Mapping[str, float | None]) -> float:
    """Return the largest difference of two outputs' metrics; NaN where only one has a value."""
    scale = found["rmse"] or 1.0
    differences = []
    for name, value in found.items():
        other = stored[name]
        if value is None or other is None:
            differences.append(0.0 if value is other else math.nan)
        else:
            differences.append(abs(value - other) / (1.0 if name == "r2" else scale))
    return math.nan if any(math.isnan(difference) for difference in differences) else max(differences)


def _ratio(now: float | None, then: float | None) -> float:
    if now is None or then is None:
        return math.nan
    return now / then if then > 0 else (1.0 if now == 0 else math.inf)


def _optional(value: Any) -> float | None:
    return None if value is None else float(value)
