"""The force of one track in the plane: how longitudinal and lateral force share the friction."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from ...block import ShearGrid
from ...parameters import RigidTerrain
from ...vehicle import TrackedVehicle
from ..blocks import COMPILED, DEFAULT
from .study import Data, Study
from .style import BLACK, CYCLE, label, new_figure

_TERRAIN: Final = RigidTerrain(0.7, 0.0, 0.025)
_SIZES: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 1.0)
_ANGLES: Final = (1.0, 2.0, 5.0, 10.0, 20.0, 45.0)
_SPEED: Final = 3.0


def compute(vehicle: TrackedVehicle, quick: bool = False) -> dict[str, Any]:
    """Return (Fx, Fy)/(μ W/2) of the left track without turning, V_ε = 0.

    Once at belts of constant speed, over the direction of the slip velocity at given size |v_s|/Vt; once at a body of
    constant speed and side slip angle to either side, over belt speeds from a hundredth of it to a hundred times.
    """
    backend = COMPILED.build(vehicle, "rigid", ShearGrid(*DEFAULT, vehicle.contact), 0.0)
    scale = _TERRAIN.mu * vehicle.weight / 2

    def left(vx: Any, vy: Any, vt: Any) -> list[list[float]]:
        columns = np.broadcast_arrays(vx, vy, 0.0, 0.0, 0.0, vt, vt, *_TERRAIN.parameters)
        rows = np.ascontiguousarray(np.column_stack(columns))
        forces = backend.track_forces(rows, rows)[:, 0, :2] / scale
        return [forces[:, 0].tolist(), forces[:, 1].tolist()]

    direction = np.radians(np.linspace(0, 360, 37 if quick else 91))
    # Dense around rolling without slip, where the force changes fast.
    fall = np.geomspace(1e-4, 0.99, 20 if quick else 60)
    belts = _SPEED * np.concatenate([1 - fall[::-1], [1.0], 1 / (1 - fall)])
    by_size = [
        {
            "size": size,
            "force": left(_SPEED * (1 + size * np.cos(direction)), _SPEED * size * np.sin(direction), _SPEED),
        }
        for size in _SIZES
    ]
    by_angle = [
        {
            "angle_deg": angle,
            "force": left(_SPEED * math.cos(math.radians(angle)), -_SPEED * math.sin(math.radians(angle)), belts),
        }
        for angle in _ANGLES
    ]
    return {
        "vehicle": vehicle.name,
        "terrain": {"mu": _TERRAIN.mu, "k": _TERRAIN.k},
        "by_size": by_size,
        "by_angle": by_angle,
    }


def draw(data: Data) -> Any:
    """Draw both families within the circle of friction."""
    figure = new_figure(10.5, 5.75)
    left, right = figure.subplots(1, 2)
    turn = np.linspace(0, 2 * np.pi, 181)
    for axis in (left, right):
        axis.plot(np.cos(turn), np.sin(turn), color=BLACK, linewidth=1.6, label="full slip, $\\mu W/2$")
    for color, curve in zip(CYCLE, data["by_size"], strict=False):
        left.plot(*curve["force"], color=color, linewidth=1.3, label=f"$|v_s|/V_t$ = {100 * curve['size']:g} %")
    for color, curve in zip(CYCLE, data["by_angle"], strict=False):
        along, aside = np.array(curve["force"])
        right.plot(along, aside, color=color, linewidth=1.3, label=f"β = ±{curve['angle_deg']:g}°")
        right.plot(along, -aside, color=color, linewidth=1.3)
    for axis, title in (
        (left, f"{data['vehicle']}, K {1e3 * data['terrain']['k']:g} mm: slip of constant size, any direction"),
        (right, "constant side slip, braked to spinning"),
    ):
        axis.axhline(0, color="0.5", linewidth=0.6)
        axis.axvline(0, color="0.5", linewidth=0.6)
        axis.set(aspect="equal", xlim=(-1.1, 1.1), ylim=(-1.1, 1.1))
        axis.set_xticks((-1, -0.5, 0, 0.5, 1))
        axis.set_yticks((-1, -0.5, 0, 0.5, 1))
        axis.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=4)
        label(axis, x="$F_x/(\\mu W/2)$ (–)", y="$F_y/(\\mu W/2)$ (–)", title=title)
    return figure


def remark(data: Data) -> str:
    """Say what bounds the force."""
    reach = max(np.hypot(*curve["force"]).max() for curve in (*data["by_size"], *data["by_angle"]))
    return (
        "Shear opposes slip, so that without turning slip of one size draws a circle, and friction μ W/2 bounds all of "
        f"them ({reach:.3f} of it is reached). At a given side slip driving and braking take from the lateral force; the "
        "locked end lies on the circle, since a slow belt shears the ground long, the spinning end a little inside."
    )


STUDY: Final = Study("friction-ellipse", "Longitudinal and lateral force of a track", compute, draw, remark)
