"""The model card of an artifact: what it is, what it was made from, how good it is, where to trust it, where it fails."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from ..terrain import OUTPUT_NAMES, interface
from .artifact import Surrogate

_SYMBOLS: Final = {"qx": "Qx", "qy": "Qy", "mz": "Mz"}
_UNITS: Final = {"qx": "N", "qy": "N", "mz": "N m"}
_RECIPE: Final = (
    "family", "hidden", "activation", "dropout", "weight_decay", "schedule", "learning_rate", "batch_size", "epochs",
    "output_weights", "huber_delta", "perturbed_copies", "space_filling_rows", "symmetries", "whiten", "seed",
)  # fmt: skip


def model_card(surrogate: Surrogate, name: str) -> str:
    """Return the card as Markdown.

    Parameters
    ----------
    surrogate : Surrogate
        The artifact; parts that it does not hold are left out.
    name : str
        What to call it.
    """
    family = "structured: a network for one track's shear" if surrogate.structured else "plain: columns to forces"
    recipe, metrics = surrogate.recipe, surrogate.metrics
    teacher = recipe.get("teacher", {})
    parts = [
        f"# {name}",
        (
            f"Track-terrain forces of the {surrogate.vehicle.name} on {surrogate.mode} ground, {surrogate.range_name} "
            f"ranges. Family: {family}."
        ),
        _facts(
            {
                "network": "-".join(map(str, surrogate.network.widths)) + f", {surrogate.network.activation}",
                "parameters": str(surrogate.network.parameter_count),
                "content hash": surrogate.content_hash,
                "dataset hash": surrogate.dataset_hash or "none",
                "teacher": ", ".join(f"{key} {value}" for key, value in sorted(teacher.items())) or "not stated",
            }
        ),
        "## Recipe",
        _facts({key: str(recipe[key]) for key in _RECIPE if key in recipe}),
    ]
    if "test" in metrics:
        parts += ["## Unseen runs", _metrics_table(metrics["test"])]
    if "maneuvers" in metrics:
        parts += ["R² by maneuver (–: the output does not vary there):", _maneuvers_table(metrics["maneuvers"])]
    parts += ["## Where to trust it", _envelope(surrogate), "## Known failures", _failures(surrogate)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _facts(facts: Mapping[str, str]) -> str:
    return "\n".join(f"- {key.replace('_', ' ')}: {value}" for key, value in facts.items())


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _metrics_table(test: Mapping[str, Mapping[str, Any]]) -> str:
    rows = ["| output | unit | R² | RMSE | P95 of \\|error\\| | largest |", "|---|---|---:|---:|---:|---:|"]
    for output in OUTPUT_NAMES:
        values = test[output]
        rows.append(
            f"| {_SYMBOLS[output]} | {_UNITS[output]} | {_number(values['r2'], '.5f')} | {values['rmse']:.1f} | "
            f"{values['p95_abs']:.1f} | {values['max_abs']:.1f} |"
        )
    return "\n".join(rows)


def _maneuvers_table(maneuvers: Mapping[str, Mapping[str, float | None]]) -> str:
    rows = ["| maneuver | Qx | Qy | Mz |", "|---|---:|---:|---:|"]
    for name, values in sorted(maneuvers.items()):
        rows.append(f"| {name} | " + " | ".join(_number(values[output], ".5f") for output in OUTPUT_NAMES) + " |")
    return "\n".join(rows)


def _envelope(surrogate: Surrogate) -> str:
    table, detector = interface(surrogate.mode), surrogate.detector
    rows = ["The detector's box; beyond it, or far from the training data, a guarded backend asks the physics.", ""]
    rows += ["| column | unit | low | high |", "|---|---|---:|---:|"]
    for column, low, high in zip(table.inputs, detector.low, detector.high, strict=True):
        rows.append(f"| {column.name} | {column.unit} | {low:.4g} | {high:.4g} |")
    promise = (
        f"Distance threshold {detector.threshold:.4g}, from {detector.calibration_runs} runs: at most "
        f"{100 * detector.alpha:g} % of runs have more than 1 % of their samples flagged"
    )
    held = "." if detector.rank_attained else "; there were too few runs for that rank, and the promise is weaker."
    return "\n".join(rows) + "\n\n" + promise + held


def _failures(surrogate: Surrogate) -> str:
    failures = []
    metrics = surrogate.metrics
    if "worst_run" in metrics:
        worst = metrics["worst_run"]
        failures.append(
            f"Worst unseen run: number {worst['run']} ({worst['maneuver']}), Mz RMSE {worst['mz_rmse']:.1f} N m, largest "
            f"error {worst['mz_max_abs']:.1f} N m."
        )
    if "test" in metrics:
        failures.append(
            "Largest errors on unseen runs: "
            + ", ".join(f"{_SYMBOLS[o]} {metrics['test'][o]['max_abs']:.0f} {_UNITS[o]}" for o in OUTPUT_NAMES)
            + "."
        )
    if surrogate.structured:
        failures.append(
            "Turns about a point under a track, where sliding changes its direction between two shear points, are the "
            "hardest. The force at rest is exactly zero, and the mirror image of an input gives the mirrored force."
        )
    else:
        failures.append(
            "A straight run has a small yaw moment and a parked vehicle creeps: a plain network knows neither the "
            "symmetry nor rest. It does not know the tracks apart."
        )
    return "\n".join(f"- {failure}" for failure in failures)
