"""The study's figures as JSON holds them, each with its unit and, where there is one, its target."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from grouser.terrain import FloatArray, RigidTerrain, TrackedVehicle

from .chatter import NUDGE, Chatter
from .cost import Cost
from .hosts import EXPLICIT, METHODS, PROMISED_ORDER, TICKS
from .live import LABELS, STOP, LiveStudy
from .order import Errors, OrderStudy
from .runs import observed_order
from .stability import (
    FRICTION,
    Probe,
    StabilityMap,
    exact_largest_tick,
    formula,
    lowest_stable_speed,
)

_NAMES: Final = [f"{1000 * tick:g} ms" for tick in TICKS]
_UNITS: Final = np.array([1e3, 1e3, 1e3])
# Least order that counts as the promised one: 0.1 below it for each order.
_ORDER_SLACK: Final = 0.1
#: The page of equations, from other and more abrupt runs, each method at 10 ms against itself at 0.5 ms.
EARLIER: Final = {
    "euler": [15, 8.8, 7.5],
    "ros2": [3.8, 1.7, 2.2],
    "implicit": [6.6, 5.0, 3.8],
    "implicit, two half-steps": [3.3, 2.5, 1.9],
    "sdirk2": [3.1, 1.4, 1.8],
}
TABLE_SOFT_SPEEDS: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


def significant(value: float, digits: int = 4) -> float:
    """Round to significant digits."""
    return float(f"{value:.{digits}g}")


def _by_tick(values: list[float], scale: float = 1.0) -> dict[str, float]:
    return {name: significant(scale * value) for name, value in zip(_NAMES, values, strict=True)}


def order_results(studies: dict[str, OrderStudy]) -> dict[str, Any]:
    """Orders, and whether they are the promised ones."""
    targets = {method: (1 - _ORDER_SLACK) * order for method, order in PROMISED_ORDER.items()}

    def table(entries: list[Errors]) -> dict[str, Any]:
        return {
            entry.label: {
                "error": _by_tick(entry.errors, 1e3),
                "order": significant(entry.order, 3),
                "order from 2 to 1 ms": significant(entry.last_order, 3),
            }
            for entry in entries
        }

    return {
        "unit": "mm/s, root mean square of (Vx, Vy, B/2 yaw rate) over a drive of 2 s at 6 m/s",
        "target": {method: f">= {target:.1f} with memory and belts held" for method, target in targets.items()},
        "met": all(
            entry.order >= targets[method]
            for study in studies.values()
            for method, entry in zip(METHODS, study.held, strict=True)
        ),
        "cases": {
            name: {
                "against Radau in the tick, memory and belts held": table(study.held),
                "against Radau in the tick, own memory and belts": table(study.own),
                "against continuous time": table(study.live),
            }
            for name, study in studies.items()
        },
    }


def live_results(studies: dict[str, LiveStudy]) -> dict[str, Any]:
    """Errors in continuous time, by component."""

    def rows(errors: FloatArray) -> dict[str, Any]:
        return {
            name: [significant(value, 3) if value > 1e-9 else 0.0 for value in row]
            for name, row in zip(_NAMES, (errors * _UNITS).tolist(), strict=True)
        }

    def case(study: LiveStudy) -> dict[str, Any]:
        return {
            "driven runs": {label: rows(study.pooled(label)) for label in LABELS},
            "order over the driven runs": {
                label: significant(observed_order(TICKS, np.linalg.norm(study.pooled(label), axis=1).tolist()), 3)
                for label in LABELS
            },
            "runs at 10 ms": {
                run: {label: rows(by[label])[_NAMES[0]] for label in LABELS} for run, by in study.errors.items()
            },
            "largest spectral radius of dQ/da/m": significant(study.memory_gain, 3),
            "reference against a hundredfold tolerance": significant(study.reference_error, 2),
        }

    gains = [study.memory_gain for study in studies.values()]
    return {
        "unit": "mm/s, mm/s, mrad/s: root-mean-square error of (Vx, Vy, yaw rate); " + f"driven runs leave out {STOP}",
        "beside": {
            "source": "the page of equations: other, more abrupt runs, 10 ms against 0.5 ms",
            "figures": EARLIER,
        },
        "target": "memory converges: spectral radius below 1",
        "met": max(gains) < 1.0,
        "cases": {name: case(study) for name, study in studies.items()},
    }


def chatter_results(studies: dict[str, list[Chatter]]) -> dict[str, Any]:
    """Jumps of force and moment, and the speed left."""
    stops = [
        c for rows in studies.values() for c in rows if c.maneuver == "brake" and c.method in ("implicit", "sdirk2")
    ]
    return {
        "stiff ground": "mu 1, fr 0.03, K 5 mm",
        "unit": "N and N m: root-mean-square change from tick to tick over the last 2 of 5 s; mm/s: speed left after "
        f"braking from 3 m/s, and straight on at 3 m/s, nudged by {NUDGE:g} rad/s, distance from continuous time",
        "target": "implicit and sdirk2, brake: below 1 N and 1e-3 mm/s",
        "met": all(c.force_change < 1.0 and c.speed_left < 1e-6 for c in stops),
        "cases": {
            name: {
                maneuver: {
                    method: {
                        f"{1000 * c.tick:g} ms": {
                            "qx": significant(c.force_change, 3),
                            "mz": significant(c.moment_change, 3),
                            "speed": significant(1e3 * c.speed_left, 3),
                        }
                        for c in rows
                        if c.maneuver == maneuver and c.method == method
                    }
                    for method in METHODS
                }
                for maneuver in ("brake", "straight")
            }
            for name, rows in studies.items()
        },
    }


def cost_results(costs: list[Cost]) -> dict[str, Any]:
    """Force calls and wall time."""
    return {
        "unit": "calls a simulated second; wall time over the implicit 10 ms tick's, medians of interleaved rounds",
        "implicit_10_ms_seconds_a_simulated_second": significant(costs[0].wall, 3),
        "methods": {
            method: {
                f"{1000 * cost.tick:g} ms": {
                    "forces": cost.plain,
                    "forces and Jacobian": cost.with_jacobian,
                    "wall_ratio": significant(cost.wall_ratio, 3),
                }
                for cost in costs
                if cost.method == method
            }
            for method in METHODS
        },
    }


def stability_results(vehicle: TrackedVehicle, maps: list[StabilityMap], probes: list[Probe]) -> dict[str, Any]:
    """Eigenvalues beside the formula, the lowest stable speeds, and the simulated checks."""

    def ground(entry: StabilityMap) -> dict[str, Any]:
        terrain = RigidTerrain(FRICTION, 0.0, entry.shear_modulus)
        expected = np.array([[formula(vehicle, terrain, e, v) for v in entry.speeds] for e in entry.soft_speeds])
        ratio = entry.stiffness / expected
        real = max(
            float(np.max(np.abs(exact_largest_tick(method, entry.eigenvalues) / entry.largest_tick(method) - 1)))
            for method in EXPLICIT
        )
        return {
            "eigenvalue over formula": [significant(float(np.min(ratio))), significant(float(np.max(ratio)))],
            "largest tick by |R| <= 1 against z/|lambda|, relative difference": significant(real, 2),
            "lowest stable speed of a 1 kHz host, m/s": {
                method: {
                    f"soft speed {e:g} m/s": significant(
                        lowest_stable_speed(vehicle, entry.shear_modulus, e, method), 3
                    )
                    for e in TABLE_SOFT_SPEEDS
                }
                for method in EXPLICIT
            },
        }

    return {
        "unit": "1/s for eigenvalues, s for ticks; m113, mu 0.8, straight running without slip or rolling resistance",
        "formula": "|lambda| = mu g L/(2 K sqrt(V^2 + V_eps^2))",
        "largest stable tick": "2/|lambda| (Euler), 2.785/|lambda| (RK4)",
        "grounds": {f"K {entry.shear_modulus:g} m": ground(entry) for entry in maps},
        "target": "every simulated disturbance grows above the boundary and decays below it",
        "met": all(probe.agrees for probe in probes),
        "agreeing": f"{sum(probe.agrees for probe in probes)} of {len(probes)}",
        "largest relative difference of growth a tick": significant(
            max(abs(probe.growth / probe.predicted - 1) for probe in probes), 2
        ),
        "probes": [
            {
                "k": probe.shear_modulus,
                "soft_speed": probe.soft_speed,
                "speed": probe.speed,
                "method": probe.method,
                "tick_over_limit": probe.share,
                "tick": significant(probe.tick),
                "predicted_growth": significant(probe.predicted),
                "simulated_growth": significant(probe.growth),
            }
            for probe in probes
        ],
    }
