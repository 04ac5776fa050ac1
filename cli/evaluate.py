"""``grouser evaluate``: a surrogate against a dataset."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..terrain import ArtifactError
from ._console import out, print_facts
from ._tables import metrics_table, number, table

if TYPE_CHECKING:
    from ..surrogate import Surrogate
    from ..surrogate.offline import Dataset

Split = Literal["test", "all"]


def evaluate(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="Surrogate that grouser train made.")],
    dataset: Annotated[Path, typer.Argument(metavar="DATASET", help="Folder that grouser data made.")],
    split: Annotated[
        Split, typer.Option(help="Of the dataset that it was trained on: the unseen runs, or all. Others: always all.")
    ] = "test",
    worst: Annotated[int, typer.Option(min=0, help="How many of the worst runs to list.")] = 3,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="Gets the figures, too.")] = None,
) -> None:
    """Measure a surrogate's forces against those that a dataset logged, output by output.

    On the dataset that it was trained on, only its own test runs count, unless --split all. On any other dataset of
    the vehicle and mode, all runs are unseen and all count.
    """
    from ..surrogate import Surrogate
    from ..surrogate.offline import force_metrics, load_dataset, metrics_to_dict, worst_runs
    from ..terrain import write_json

    surrogate, whole = Surrogate.load(artifact), load_dataset(dataset)
    surrogate.require(whole.vehicle, whole.manifest.mode)
    chosen, which = _chosen(surrogate, whole, split)
    predicted = surrogate.reference_forces(chosen.inputs)
    metrics = metrics_to_dict(force_metrics(predicted, chosen.forces))
    runs = worst_runs(predicted, chosen.forces, chosen.run_index, chosen.records, count=worst)
    outside = float((surrogate.detector.score(chosen.inputs) > 1.0).mean())

    out.print(metrics_table(f"{artifact.stem} on {len(chosen.records)} runs ({which})", metrics))
    if runs:
        listed = table("Worst runs, by Mz in N m", ["maneuver", "run", "RMSE", "P95 of |error|", "max |error|"])
        for run in runs:
            errors = (run.mz_rmse, run.mz_p95_abs, run.mz_max_abs)
            listed.add_row(run.maneuver, str(run.run), *(number(value, ".1f") for value in errors))
        out.print(listed)
    print_facts(
        {
            "out of distribution": f"{100 * outside:.2f} % of {len(chosen.inputs)} samples, by its own detector",
            "artifact": surrogate.content_hash,
            "dataset": whole.manifest.content_hash,
        }
    )
    if json is not None:
        json.parent.mkdir(parents=True, exist_ok=True)
        write_json(
            json,
            {
                "artifact": surrogate.content_hash,
                "dataset": whole.manifest.content_hash,
                "split": which,
                "runs": [record.run for record in chosen.records],
                "metrics": metrics,
                "worst_runs": [asdict(run) for run in runs],
                "out_of_distribution": outside,
            },
        )


def _chosen(surrogate: Surrogate, whole: Dataset, split: Split) -> tuple[Dataset, str]:
    """Return the runs to judge by, and in words which they are."""
    from ..surrogate.offline.joining import HASH_SEPARATOR

    content_hash = whole.manifest.content_hash
    if surrogate.dataset_hash != content_hash and content_hash in surrogate.dataset_hash.split(HASH_SEPARATOR):
        if split == "all":
            return whole, "all of one of the datasets that it was trained on, training runs included"
        raise ArtifactError("it was trained on this dataset joined with others; pass --split all")
    if surrogate.dataset_hash != content_hash:
        return whole, "all of a dataset that it was not trained on"
    if split == "all":
        return whole, "all of the dataset that it was trained on, training runs included"
    try:
        return whole.select(surrogate.recipe["split"]["test"]), "its own test runs"
    except (KeyError, TypeError) as error:
        raise ArtifactError("the artifact does not say which runs it was tested on; pass --split all") from error
