"""The tightest steady turn against speed, on every named ground."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from ...block import ShearGrid
from ...closed_forms import shear_capacity
from ...errors import InvalidInputError
from ...named import named, terrain_names
from ...steady import tightest_turn
from ...vehicle import GRAVITY, TrackedVehicle
from ..blocks import COMPILED, DEFAULT
from .grounds import KINDS, ground_kind
from .study import Data, Study
from .style import CYCLE, label, new_figure, plain_ticks

_SMALLEST: Final = 1.0


def compute(vehicle: TrackedVehicle, quick: bool = False) -> dict[str, Any]:
    """Return the tightest steady radius by speed and ground, with any inner belt and with none that runs backward.

    Turns are not followed below 1 m; null where the vehicle cannot hold the speed straight on.
    """
    # Closer to each other towards the maximum speed, where the drive's limit sets in.
    shares = (0.06, 0.3, 0.9) if quick else np.concatenate([np.geomspace(0.05, 0.7, 18), np.linspace(0.75, 0.99, 9)])
    speeds = np.array(shares) * vehicle.maximum_speed
    curves = []
    for name in terrain_names():
        terrain = named(name)
        grid = ShearGrid(*((4, 2) if quick else DEFAULT), vehicle.contact)
        backend = COMPILED.build(vehicle, terrain.mode, grid, vehicle.soft_speed)
        radii: dict[str, list[float | None]] = {"any": [], "forward": []}
        for speed in speeds.tolist():
            try:
                turn = tightest_turn(backend, terrain, speed, minimum_radius=_SMALLEST)
            except InvalidInputError:
                radii["any"].append(None)
                radii["forward"].append(None)
                continue
            radii["any"].append(_finite(turn.radius))
            if turn.v_left < 0:
                turn = tightest_turn(
                    backend, terrain, speed, minimum_radius=_SMALLEST, inner_belt_reverses=False
                )  # fmt: skip
            radii["forward"].append(_finite(turn.radius))
        grip = shear_capacity(vehicle, terrain) / vehicle.weight
        curves.append({"name": name, "kind": ground_kind(name), "friction": grip, "radius_m": radii})
    return {
        "vehicle": vehicle.name,
        "maximum_speed": vehicle.maximum_speed,
        "smallest_radius_m": _SMALLEST,
        "speed": speeds.tolist(),
        "curves": curves,
    }


def _finite(radius: float) -> float | None:
    return radius if math.isfinite(radius) else None


def draw(data: Data) -> Any:
    """Draw one panel for each kind of ground, and say in the last what the lines are."""
    kinds = [kind for kind in KINDS if any(curve["kind"] == kind for curve in data["curves"])]
    columns = 2
    rows = len(kinds) // columns + 1
    figure = new_figure(10.5, 4.0 * rows)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    speed = np.array(data["speed"])
    for axis, kind in zip(axes.flat, kinds, strict=False):
        chosen = [curve for curve in data["curves"] if curve["kind"] == kind]
        # The legend reads in the order in which the curves lie.
        for color, curve in zip(CYCLE, sorted(chosen, key=lambda curve: curve["friction"]), strict=False):
            solid, dashed = (np.array(curve["radius_m"][key], dtype=float) for key in ("any", "forward"))
            axis.plot(speed, solid, color=color, linewidth=1.6, label=curve["name"])
            axis.plot(speed, dashed, color=color, linewidth=1.2, linestyle="--")
            axis.plot(speed, speed**2 / (GRAVITY * curve["friction"]), color=color, linewidth=0.8, linestyle=":")
        axis.set(
            xscale="log",
            yscale="log",
            xlim=(speed[0], data["maximum_speed"]),
            ylim=(0.9 * data["smallest_radius_m"], 1e3),
        )
        plain_ticks(axis.xaxis, [tick for tick in (1, 2, 5, 10, 15) if speed[0] <= tick <= data["maximum_speed"]])
        plain_ticks(axis.yaxis, (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000))
        axis.xaxis.set_tick_params(labelbottom=True)
        axis.legend(fontsize=8, loc="upper left")
        label(axis, x="speed $V$ (m/s)", y="smallest steady radius $R$ (m)", title=f"{data['vehicle']}, {kind}")
    lines = axes.flat[len(kinds)]
    for style, width, text in (
        ("-", 1.6, "any inner belt"),
        ("--", 1.2, "inner belt not reversed"),
        (":", 0.8, "$V^2W/(g F_{max})$: all friction held sideways"),
    ):
        lines.plot([], [], style, color="0.3", linewidth=width, label=text)
    lines.set_axis_off()
    lines.legend(fontsize=10, loc="center")
    for axis in axes.flat[len(kinds) + 1 :]:
        axis.remove()
    return figure


def remark(data: Data) -> str:
    """Say what limits the turn at either end."""
    reached = {curve["name"]: curve["radius_m"]["any"] for curve in data["curves"]}
    mute = [name for name, radii in reached.items() if None in radii]
    note = f" Not every speed is held straight on: {', '.join(mute)}." if mute else ""
    return (
        f"Slow turns were followed down to {data['smallest_radius_m']:g} m; where the inner belt may not reverse they end "
        "a little outside half the tread, with that belt at rest. Then the friction limit (dotted) rules, and the closer, "
        "the less of the friction goes into rolling resistance: on packed snow that takes nearly all, and the vehicle "
        "hardly turns, slowly only with the outer belt spinning at the drive's limit. Towards the maximum speed the outer belt is at the drive's limit. A steady turn need not be a "
        f"stable one.{note}"
    )


STUDY: Final = Study("turning-radius", "Tightest steady turn against speed", compute, draw, remark)
