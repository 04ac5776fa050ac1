"""``grouser train``: a surrogate of a dataset's force block."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import typer

from ..terrain import ConfigurationError, InvalidInputError, write_aside
from ._console import StageBars, out, print_facts
from ._options import Seed, Workers, numbers, whole_numbers
from ._tables import metrics_table

if TYPE_CHECKING:
    from ..surrogate.offline import EpochReport, TrainingConfig
    from ..surrogate.offline.board import Board

_PRESET_FOLDER: Final = Path("build/presets")
#: What may be said beside --preset; every other option is part of its recipe.
_BESIDE_PRESET: Final = ("dataset", "output", "preset", "seed", "tensorboard", "workers", "threads")


def train(
    context: typer.Context,
    dataset: Annotated[
        Path | None, typer.Argument(metavar="DATASET", help="Folder that grouser data made.", show_default=False)
    ] = None,
    output: Annotated[
        Path | None, typer.Argument(metavar="OUTPUT.safetensors", help="The surrogate.", show_default=False)
    ] = None,
    also: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DATASET", help="Another dataset of the same block to join; again for more.", show_default=False
        ),
    ] = None,
    preset: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Make a shipped artifact again, its data too: m113-rigid, m113-soil-paper-recipe, ...",
            show_default=False,
        ),
    ] = "",
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
    space_filling_rows: Annotated[
        int, typer.Option(help="Rows that fill the space of track slip, answered by the physics.")
    ] = 0,
    symmetries: Annotated[bool, typer.Option(help="Train on mirror images and reversals too.")] = True,
    whiten: Annotated[bool, typer.Option(help="Train the first layer in whitened coordinates.")] = True,
    dropout: Annotated[float, typer.Option(help="Share of units that are dropped.")] = 0.0,
    weight_decay: Annotated[float, typer.Option(help="L2 penalty.")] = 0.0,
    output_weights: Annotated[str, typer.Option(metavar="W,W,W", help="Weights of Qx, Qy, Mz in the loss.")] = "1,1,3",
    huber_delta: Annotated[
        float, typer.Option(help="Where the loss turns from square to linear, in standard deviations.")
    ] = 1.0,
    tensorboard: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Gets the learning curves.")] = None,
    workers: Workers = 2,
    threads: Annotated[int, typer.Option(help="Of torch; with more than one, bits may differ between calls.")] = 1,
    seed: Seed = 0,
) -> None:
    """Train a surrogate on a dataset, and measure it on runs that it has not seen.

    Runs are split into training, validation and test, maneuver by maneuver. The artifact holds the network, its
    normalizers, the detector that says where to trust it, the recipe and the test metrics; its model card is written
    beside it. Interrupted, the same command goes on from the last whole epoch and ends at the same weights.

    With --preset neither DATASET nor OUTPUT is needed: both go into build/presets.
    """
    from ..surrogate import model_card
    from ..surrogate.offline import TrainingConfig, join_datasets, load_dataset, train_surrogate

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
        space_filling_rows=space_filling_rows,
        symmetries=symmetries,
        whiten=whiten,
        seed=seed,
    )
    began = perf_counter()
    with StageBars() as tell, ExitStack() as open_boards:
        if preset:
            config, dataset, output = _from_preset(context, preset, dataset, output, seed, workers, tell)
        elif dataset is None or output is None:
            raise InvalidInputError("give DATASET and OUTPUT.safetensors, or --preset NAME")
        loaded = join_datasets([load_dataset(folder) for folder in (dataset, *(also or ()))])
        board = None if tensorboard is None else open_boards.enter_context(_board(tensorboard))

        def report(epoch: EpochReport) -> None:
            best = ", best so far" if epoch.improved else ""
            note = f"loss {epoch.train_loss:.5f}, validation {epoch.validation_loss:.5f}{best}"
            tell("epochs", epoch.epoch, epoch.epochs, note)
            if board is not None:
                board(epoch)

        result = train_surrogate(loaded, config, output, report=report, threads=threads)
    surrogate = result.surrogate
    card = output.with_suffix(".md")
    write_aside(card, model_card(surrogate, output.stem).encode())
    out.print(metrics_table(f"Test, {len(result.split.test)} runs", surrogate.metrics["test"]))
    print_facts(
        {
            "artifact": output,
            "model card": card,
            "content hash": surrogate.content_hash,
            "dataset": surrogate.dataset_hash,
            "time": f"{perf_counter() - began:.1f} s",
        }
    )


def _from_preset(
    context: typer.Context,
    name: str,
    dataset: Path | None,
    output: Path | None,
    seed: int,
    workers: int,
    tell: StageBars,
) -> tuple[TrainingConfig, Path, Path]:
    """Return recipe, dataset and output of a preset, once its dataset is there."""
    from ..surrogate.offline import generate_dataset, preset

    # By name: typer brings a click of its own, whose enumeration is another one.
    sources = {key: context.get_parameter_source(key) for key in context.params}
    typed = [key for key, source in sources.items() if source is not None and source.name == "COMMANDLINE"]
    refused = sorted(f"--{key.replace('_', '-')}" for key in typed if key not in _BESIDE_PRESET)
    if refused:
        raise ConfigurationError(f"--preset {name} is a whole recipe: leave out {', '.join(refused)}")
    chosen = preset(name, seed=seed)
    dataset = dataset or _PRESET_FOLDER / chosen.dataset_name
    generate_dataset(chosen.data, dataset, workers=workers, progress=lambda done, total: tell("runs", done, total))
    return chosen.training, dataset, output or _PRESET_FOLDER / f"{name}.safetensors"


def _board(folder: Path) -> Board:
    from ..surrogate.offline.board import Board

    return Board(folder)
