"""What a validation leaves in its folder: ``validation.json``, ``index.md`` and a figure for each study."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from ..files import write_aside
from ..vehicle import TrackedVehicle
from .check import Check
from .checks import run_checks
from .studies import STUDIES, Study, png

_DIGITS: Final = 6
_TITLES: Final = {
    1: "Golden state",
    2: "Thrust on straight runs",
    3: "Full-slip yaw moments",
    4: "Steady skid turn",
    5: "Turning resistance",
    6: "Lateral saturation",
    7: "Power and loads",
    8: "Symmetry",
    9: "Grid convergence",
    10: "Agreement of the implementations",
}


@dataclass(frozen=True)
class Validation:
    """Checks and studies of one vehicle's block.

    Parameters
    ----------
    vehicle : str
        Name of the vehicle.
    checks : tuple of Check
        Sorted by group.
    studies : mapping of str to mapping
        Data of each study by its name.
    """

    vehicle: str
    checks: tuple[Check, ...]
    studies: Mapping[str, Mapping[str, Any]]

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that are not within their tolerance."""
        return tuple(check for check in self.checks if not check.passed)


def validate(
    vehicle: TrackedVehicle, *, quick: bool = False, progress: Callable[[str, int, int], None] | None = None
) -> Validation:
    """Run every check and compute every study.

    Parameters
    ----------
    vehicle : TrackedVehicle
        Whose block is validated; its contact elements meet.
    quick : bool
        Fewer states, coarser studies.
    progress : callable, optional
        Called with a stage, and how many of its steps are done, of how many.

    Raises
    ------
    InvalidInputError
        If the vehicle's contact elements leave gaps.
    """
    tell = progress or (lambda stage, done, total: None)
    checks = run_checks(vehicle, quick=quick, progress=lambda done, total: tell("checks", done, total))
    studies = {}
    for done, study in enumerate(STUDIES, start=1):
        studies[study.name] = rounded(study.compute(vehicle, quick))
        tell("studies", done, len(STUDIES))
    return Validation(vehicle.name, tuple(checks), studies)


def write_validation(
    folder: Path,
    validation: Validation,
    meta: Mapping[str, Any],
    progress: Callable[[str, int, int], None] | None = None,
) -> list[Path]:
    """Write ``validation.json``, ``index.md`` and the figures; return the files.

    Everything but ``meta`` is determined by vehicle and options.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    validation : Validation
        Checks and studies.
    meta : mapping
        Command, version and machine; ``meta["command"]`` is repeated in the page.
    progress : callable, optional
        As for :func:`validate`.

    Raises
    ------
    ConfigurationError
        If matplotlib is not installed.
    """
    files = []
    for done, study in enumerate(STUDIES, start=1):
        figure = study.draw(validation.studies[study.name])
        files.append(write_aside(folder / f"{study.name}.png", png(figure)))
        if progress is not None:
            progress("figures", done, len(STUDIES))
    document = {
        "meta": dict(meta),
        "vehicle": validation.vehicle,
        "checks": [check.to_dict() for check in validation.checks],
        "studies": {name: dict(data) for name, data in validation.studies.items()},
    }
    files.append(write_aside(folder / "validation.json", _json(document)))
    files.append(write_aside(folder / "index.md", page(validation, str(meta["command"])).encode()))
    return files


def page(validation: Validation, command: str) -> str:
    """Return the report as Markdown: the table of checks, then every study with its figure."""
    failed = validation.failed
    verdict = "All are within tolerance." if not failed else f"**{len(failed)} not within tolerance.**"
    summary = (
        f"Made by `{command}`; every figure stands in [validation.json](validation.json). Vehicle: "
        f"`{validation.vehicle}`. {len(validation.checks)} checks of the compiled block, of its NumPy oracle and of the "
        f"closed forms. {verdict}"
    )
    lines = [
        "# Validation of the track-terrain block",
        "",
        summary,
        "",
        "Differences are absolute, or relative to the expected value where marked %; an error is compared with 0.",
        "",
    ]
    numbers = sorted({check.number for check in validation.checks})
    for number in numbers:
        chosen = [check for check in validation.checks if check.number == number]
        lines += [f"## {number}. {_TITLES[number]}", "", *_table(chosen), ""]
    lines += ["## Studies", ""]
    for study in STUDIES:
        lines += _section(study, validation.studies[study.name])
    return "\n".join(lines).rstrip() + "\n"


def format_value(value: float) -> str:
    """Return a figure as the tables print it: six digits, small and large ones with an exponent."""
    return "0" if value == 0 else f"{value:.6g}" if 1e-3 <= abs(value) < 1e7 else f"{value:.1e}"


def format_difference(check: Check) -> tuple[str, str]:
    """Return difference and tolerance as the tables print them, in percent where they are relative."""
    if check.kind == "relative":
        return f"{100 * check.difference:+.1e} %", f"{100 * check.tolerance:g} %"
    difference = "0" if check.difference == 0 else f"{check.difference:+.1e}"
    return difference, f"{check.tolerance:g}"


def rounded(value: Any) -> Any:
    """Return data with every float at six significant digits, so that machines agree on them, and none not finite.

    Raises
    ------
    ValueError
        If a float is not finite: JSON has none.
    """
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"study data must be finite, got {value!r}")
        return float(f"{value:.{_DIGITS}g}")
    if isinstance(value, Mapping):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(item) for item in value]
    return value


def _json(document: Mapping[str, Any]) -> bytes:
    """Return JSON with sorted keys and every list of numbers on one line."""
    text = json.dumps(document, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False)
    text = re.sub(r"\[[^][{}\"]*\]", lambda numbers: " ".join(numbers[0].split()), text)
    return (text + "\n").encode()


def _table(checks: Sequence[Check]) -> list[str]:
    rows = [
        "| check | block | quantity | unit | expected | measured | difference | tolerance | passed | source |",
        "|---|---|---|---|---:|---:|---:|---:|---|---|",
    ]
    for check in checks:
        difference, tolerance = format_difference(check)
        cells = (
            check.name, check.block, check.quantity, check.unit, format_value(check.expected),
            format_value(check.measured), difference, tolerance, "yes" if check.passed else "**no**", check.source,
        )  # fmt: skip
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return rows


def _section(study: Study, data: Mapping[str, Any]) -> list[str]:
    return [f"### {study.title}", "", f"![{study.title}]({study.name}.png)", "", study.remark(data), ""]
