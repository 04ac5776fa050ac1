"""``grouser list``: what has a name, and where its numbers come from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final

import typer
from rich.markup import escape
from rich.table import Table

from ..envs import path_names
from ..terrain import (
    RANGE_NAMES,
    Sheet,
    SourcedNumber,
    Terrain,
    TrackedVehicle,
    backend_names,
    named,
    parameter_ranges,
    terrain_names,
    terrain_sheet,
    vehicle_names,
    vehicle_sheet,
)
from ._console import out, print_facts
from ._options import starting_with
from ._tables import table

if TYPE_CHECKING:
    from ..controllers import Policy

listing = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="List vehicles, grounds, backends, paths and policies by name, and where their numbers come from.",
)

_VEHICLE_COLUMNS: Final = {
    "mass": "mass,\nkg",
    "yaw_inertia": "yaw inertia,\nkg m²",
    "contact_length": "contact\nlength, m",
    "tread": "tread,\nm",
    "track_width": "track\nwidth, m",
    "road_wheels": "wheels\na side",
    "maximum_speed": "maximum\nspeed, m/s",
}
_TERRAIN_COLUMNS: Final = {"mu": "μ", "c_kpa": "c, kPa", "phi_deg": "φ, °", "fr": "f_r", "k": "K, m"}
_MARKS: Final[dict[str, str]] = {"published": "", "derived": "", "assumed": "*", "synthetic": "†"}
_LEGEND: Final = "* assumed, † synthetic"


@listing.command(epilog="Example: grouser list vehicles m113")
def vehicles(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME|FILE.toml",
            help="One vehicle, by name or from a file of your own.",
            show_default=False,
            autocompletion=starting_with(vehicle_names),
        ),
    ] = "",
) -> None:
    """List the vehicles that --vehicle takes by name; of one of them, every number with its unit, kind and source.

    A number is published, derived from published ones, assumed, or synthetic. The list marks the last two, and its
    last column counts them among all numbers of the vehicle, those that it does not show included.
    """
    if name:
        vehicle = TrackedVehicle.preset(name)
        out.print(_numbers_table(vehicle_sheet(name)))
        print_facts({"contact": vehicle.contact, "synthetic": "yes" if vehicle.synthetic else "no"})
        return
    made = table("Vehicles", ["name", "what it is", *_VEHICLE_COLUMNS.values(), "* or †"], text_columns=2)
    for each in vehicle_names():
        sheet = vehicle_sheet(each)
        unsure = sum(bool(_MARKS[number.kind]) for number in sheet.numbers)
        made.add_row(each, sheet.summary, *_marked(sheet, _VEHICLE_COLUMNS), f"{unsure} of {len(sheet.numbers)}")
    out.print(made)
    out.print(f"{_LEGEND}; sources: grouser list vehicles NAME")


@listing.command(epilog="Example: grouser list terrains lete-sand")
def terrains(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME|FILE.toml",
            help="One ground, by name or from a file of your own.",
            show_default=False,
            autocompletion=starting_with(terrain_names),
        ),
    ] = "",
) -> None:
    """List the grounds that --terrain takes by name; of one of them, every number with its unit, kind and source.

    The columns wide and paper say whether a ground lies in those ranges of training; the shipped surrogates know the
    wide ones. Outside of its ranges a plain surrogate guesses, and a guarded one falls back to physics.
    """
    if name:
        ground = named(name)
        out.print(_numbers_table(terrain_sheet(name)))
        print_facts({"mode": ground.mode, **{f"in {key} ranges": _inside(ground, key) for key in RANGE_NAMES}})
        return
    columns = ["name", "what it is", "mode", *RANGE_NAMES, *_TERRAIN_COLUMNS.values()]
    made = table("Grounds", columns, text_columns=3 + len(RANGE_NAMES))
    for each in sorted(terrain_names(), key=lambda each: named(each).mode):
        ground, sheet = named(each), terrain_sheet(each)
        inside = (_inside(ground, key) for key in RANGE_NAMES)
        made.add_row(each, sheet.summary, ground.mode, *inside, *_marked(sheet, _TERRAIN_COLUMNS))
    out.print(made)
    out.print(f"{_LEGEND}; sources: grouser list terrains NAME")


@listing.command(epilog="Example: grouser list backends")
def backends() -> None:
    """List the backends that --backend takes, one a line: whoever may be asked for the force of the ground.

    Backends that a program registers by register_backend are known to that program only. What the optional ones need
    is said by grouser doctor.
    """
    _print_names(backend_names())


@listing.command(epilog="Example: grouser list paths")
def paths() -> None:
    """List the paths that --path takes by name, one a line. It also takes a CSV file of x and y in m.

    Lanes of iso-3888-1 are as wide as the vehicle asks for; every other path is the same for all vehicles.
    """
    _print_names(path_names())


@listing.command(epilog="Example: grouser list policies")
def policies() -> None:
    """List the policies that --controller and grouser rl take by name: what they were trained in, on what, how long.

    They are judged by grouser rl eval NAME.
    """
    from ..controllers import load_policy, shipped_policies
    from ..controllers.rl.shipped import read_shipped

    columns = ["name", "environment", "algorithm", "vehicle", "trained on", "content hash", "steps", "kB"]
    made = table("Policies", columns, text_columns=6)
    for name in shipped_policies():
        policy = load_policy(name)
        trained = policy.environment
        made.add_row(
            name,
            trained["id"],
            policy.architecture.algorithm,
            trained["vehicle"]["name"],
            _trained_on(policy),
            policy.content_hash[:12],
            str(policy.recipe["steps"]),
            f"{len(read_shipped(name)) / 1000:.0f}",
        )
    out.print(made)


def _trained_on(policy: Policy) -> str:
    arguments = policy.environment["arguments"]
    settings = [policy.environment["settings"], *(stage["settings"] for stage in policy.recipe.get("curriculum", ()))]
    randomized = any(each.get("randomize") for each in settings)
    return f"{arguments['backend']}, {arguments['terrain']}{', randomized' if randomized else ''}"


def _print_names(names: tuple[str, ...]) -> None:
    for name in names:
        out.print(name)


def _inside(ground: Terrain, ranges: str) -> str:
    return "yes" if parameter_ranges(ranges, ground.mode).contains(ground) else "no"


def _marked(sheet: Sheet, columns: dict[str, str]) -> list[str]:
    """Return the numbers of the columns as text, with the mark of their kind; – where there is none."""
    numbers = {number.name: number for number in sheet.numbers}
    return [f"{_text(numbers[key])}{_MARKS[numbers[key].kind]}" if key in numbers else "–" for key in columns]


def _text(number: SourcedNumber) -> str:
    return format(number.value, ".10g")


def _numbers_table(sheet: Sheet) -> Table:
    title = f"{sheet.name}: {sheet.summary}" if sheet.summary else sheet.name
    made = table(escape(title), ["number", "value", "unit", "kind", "source"], text_columns=5)
    for number in sheet.numbers:
        made.add_row(number.name, _text(number), number.unit, number.kind, escape(number.source))
    return made
