"""``grouser train``: a surrogate of a dataset's force block."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ._console import StageBars, out, print_facts
from ._options import Seed, numbers, whole_numbers
from ._tables import metrics_table

if TYPE_CHECKING:
    from ..surrogate.offline import EpochReport


def train(
    dataset: Annotated[Path, typer.Argument(metavar="DATASET", help="Folder that grouser data made.")],
    output: Annotated[Path, typer.Argument(metavar="OUTPUT.safetensors", help="The surrogate.")],
    family: Annotated[
        Literal["plain", "structured"],
        typer.Option(help="plain: columns to forces; structured: the shear under one track, the rest computed."),
    ] = "plain",
    hidden: Annotated[str, typer.Option(metavar="N,N", help="Widths of the hidden layers.")] = "128,128",
    activation: Annotated[Literal["relu", "silu", "tanh"], typer.Option(help="Between layers.")] = "silu",
    epochs: Annotated[int, typer.Option(help="Passes over the data, at most.")] = 60,
    patience: Annotated[int, typer.Option(help="Epochs without improvement before training stops.")] = 20,
    batch_size: Annotated[int, typer.Option(help="Samples a step.")] = 1024,
    learning_rate: Annotated[float, typer.Option(help="Of Adam, at the start.")] = 2e-3,
    schedule: Annotated[
        Literal["plateau", "cosine"], typer.Option(help="Of the learning rate: falls when stuck, or over all epochs.")
    ] = "plateau",
    learning_rate_decay: Annotated[
        float, typer.Option(help="Factor on the learning rate after each epoch; short trainings need about 0.85.")
    ] = 1.0,
    plateau_patience: Annotated[
        int, typer.Option(help="Epochs without improvement before the learning rate falls.")
    ] = 4,
    plateau_factor: Annotated[float, typer.Option(help="What it falls by.")] = 0.5,
    perturbed_copies: Annotated[
        int, typer.Option(help="Copies of each training row with perturbed velocities, answered by the physics.")
    ] = 2,
    symmetries: Annotated[bool, typer.Option(help="Train on mirror images and reversals too.")] = True,
    whiten: Annotated[bool, typer.Option(help="Train the first layer in whitened coordinates.")] = True,
    dropout: Annotated[float, typer.Option(help="Share of units that are dropped.")] = 0.0,
    weight_decay: Annotated[float, typer.Option(help="L2 penalty.")] = 0.0,
    output_weights: Annotated[str, typer.Option(metavar="W,W,W", help="Weights of Qx, Qy, Mz in the loss.")] = "1,1,3",
    huber_delta: Annotated[
        float, typer.Option(help="Where the loss turns from square to linear, in standard deviations.")
    ] = 1.0,
    threads: Annotated[int, typer.Option(help="Of torch; with more than one, bits may differ between calls.")] = 1,
    seed: Seed = 0,
) -> None:
    """Train a surrogate on a dataset, and measure it on runs that it has not seen.

    Runs are split into training, validation and test, maneuver by maneuver. The artifact holds the network, its
    normalizers, the detector that says where to trust it, the recipe and the test metrics. Interrupted, the same
    command goes on from the last whole epoch and ends at the same weights.
    """
    from ..surrogate.offline import TrainingConfig, load_dataset, train_surrogate

    weights: Any = numbers(output_weights, "--output-weights")
    config = TrainingConfig(
        family=family,
        hidden=whole_numbers(hidden, "--hidden"),
        activation=activation,
        dropout=dropout,
        weight_decay=weight_decay,
        output_weights=weights,
        huber_delta=huber_delta,
        learning_rate=learning_rate,
        schedule=schedule,
        learning_rate_decay=learning_rate_decay,
        batch_size=batch_size,
        epochs=epochs,
        patience=patience,
        plateau_patience=plateau_patience,
        plateau_factor=plateau_factor,
        perturbed_copies=perturbed_copies,
        symmetries=symmetries,
        whiten=whiten,
        seed=seed,
    )
    loaded = load_dataset(dataset)
    began = perf_counter()
    with StageBars() as tell:

        def report(epoch: EpochReport) -> None:
            best = ", best so far" if epoch.improved else ""
            note = f"loss {epoch.train_loss:.5f}, validation {epoch.validation_loss:.5f}{best}"
            tell("epochs", epoch.epoch, epoch.epochs, note)

        result = train_surrogate(loaded, config, output, report=report, threads=threads)
    surrogate = result.surrogate
    out.print(metrics_table(f"Test, {len(result.split.test)} runs", surrogate.metrics["test"]))
    print_facts(
        {
            "artifact": output,
            "content hash": surrogate.content_hash,
            "dataset": surrogate.dataset_hash,
            "time": f"{perf_counter() - began:.1f} s",
        }
    )
