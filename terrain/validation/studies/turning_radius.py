"""The tightest steady turn against speed, on published grounds."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from ...block import ShearGrid
from ...closed_forms import shear_capacity
from ...errors import InvalidInputError
from ...named import named
from ...steady import tightest_turn
from ...vehicle import GRAVITY, TrackedVehicle
from ..blocks import COMPILED, DEFAULT
from .study import Data, Study
from .style import CYCLE, label, new_figure, plain_ticks

_GROUNDS: Final = (
    "asphalt", "gravel", "snow-packed", "ice",
    "heavy-clay-25", "upland-sandy-loam", "dry-sand", "snow-us",
)  # fmt: skip
_SMALLEST: Final = 1.0


def compute(vehicle: TrackedVehicle, quick: bool = False) -> dict[str, Any]:
    """Return the tightest steady radius by speed and ground, with any inner belt and with none that runs backward.

    Turns are not followed below 1 m; null where the vehicle cannot hold the speed straight on.
    """
    # Closer to each other towards the maximum speed, where the drive's limit sets in.
    shares = (0.06, 0.3, 0.9) if quick else np.concatenate([np.geomspace(0.05, 0.7, 18), np.linspace(0.75, 0.99, 9)])
    speeds = np.array(shares) * vehicle.maximum_speed
    curves = []
    for name in _GROUNDS:
        terrain = named(name)
        grid = ShearGrid(*((4, 2) if quick else DEFAULT), vehicle.contact)
        backend = COMPILED.build(vehicle, terrain.mode, grid, vehicle.soft_speed)
        radii: dict[str, list[float | None]] = {"any": [], "forward": []}
        for speed in speeds.tolist():
            for key, reverses in (("any", True), ("forward", False)):
                try:
                    turn = tightest_turn(
                        backend, terrain, speed, minimum_radius=_SMALLEST, inner_belt_reverses=reverses
                    )  # fmt: skip
                except InvalidInputError:
                    radii[key].append(None)
                else:
                    radii[key].append(turn.radius if np.isfinite(turn.radius) else None)
        grip = shear_capacity(vehicle, terrain) / vehicle.weight
        curves.append({"name": name, "mode": terrain.mode, "friction": grip, "radius_m": radii})
    return {
        "vehicle": vehicle.name,
        "maximum_speed": vehicle.maximum_speed,
        "smallest_radius_m": _SMALLEST,
        "speed": speeds.tolist(),
        "curves": curves,
    }


def draw(data: Data) -> Any:
    """Draw rigid grounds and soils side by side."""
    figure = new_figure(10.5, 5.2)
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    speed = np.array(data["speed"])
    for axis, mode, title in zip(axes, ("rigid", "soil"), ("firm ground", "soil"), strict=True):
        for color, curve in zip(CYCLE, [c for c in data["curves"] if c["mode"] == mode], strict=False):
            solid, dashed = (np.array(curve["radius_m"][key], dtype=float) for key in ("any", "forward"))
            axis.plot(speed, solid, color=color, linewidth=1.6, label=curve["name"])
            axis.plot(speed, dashed, color=color, linewidth=1.2, linestyle="--")
            axis.plot(speed, speed**2 / (GRAVITY * curve["friction"]), color=color, linewidth=0.8, linestyle=":")
        for style, width, text in (
            ("-", 1.6, "any inner belt"),
            ("--", 1.2, "inner belt not reversed"),
            (":", 0.8, "$V^2W/(g F_{max})$"),
        ):
            axis.plot([], [], style, color="0.3", linewidth=width, label=text)
        axis.set(
            xscale="log",
            yscale="log",
            xlim=(speed[0], data["maximum_speed"]),
            ylim=(0.9 * data["smallest_radius_m"], 1e3),
        )
        plain_ticks(axis.xaxis, [tick for tick in (1, 2, 5, 10, 15) if speed[0] <= tick <= data["maximum_speed"]])
        plain_ticks(axis.yaxis, (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000))
        axis.legend(fontsize=8, loc="upper left")
        label(axis, x="speed $V$ (m/s)", y="smallest steady radius $R$ (m)", title=f"{data['vehicle']}, {title}")
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
        "hardly turns. Towards the maximum speed the outer belt is at the drive's limit. A steady turn need not be a "
        f"stable one.{note}"
    )


STUDY: Final = Study("turning-radius", "Tightest steady turn against speed", compute, draw, remark)
