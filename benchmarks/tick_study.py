"""Measure the tick: order, error in continuous time, chatter, cost, and where explicit hosts stay stable.

    python -P benchmarks/tick_study.py --output build/tick

It writes ``results/tick.json`` and ``figures/tick-*.png`` below the output folder; ``--output docs`` is what the
repository holds. Times compare as ratios within one run; everything else is the same on every machine to rounding.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

# -P keeps this folder off the path. At the end of it, the repository's root shadows nothing.
sys.path.append(str(Path(__file__).resolve().parents[1]))

import grouser
from benchmarks.tick.chatter import study_chatter
from benchmarks.tick.cost import study_cost
from benchmarks.tick.figures import draw_order, draw_stability, draw_transients
from benchmarks.tick.hosts import METHODS, TICKS, Case
from benchmarks.tick.live import LABELS, study_live
from benchmarks.tick.order import study_order
from benchmarks.tick.results import (
    chatter_results,
    cost_results,
    live_results,
    order_results,
    stability_results,
)
from benchmarks.tick.stability import SHEAR_MODULI, map_stability, probe_boundary
from grouser.native import cpu_level
from grouser.terrain import RigidTerrain, TrackedVehicle, named, write_json


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("build/tick"))
    output: Path = parser.parse_args().output
    figures = output / "figures"
    m113, ugv = TrackedVehicle.preset("m113"), TrackedVehicle.preset("ugv")
    flat = replace(m113, name="m113 with its CG on the ground", cg_height=0.0)
    asphalt = Case.physics("asphalt", m113, named("asphalt"))
    stiff = Case.physics("stiff ground", m113, RigidTerrain(1.0, 0.03, 0.005))

    costs = study_cost(asphalt)
    for cost in costs:
        calls = cost.plain + cost.with_jacobian
        print(f"cost    {cost.method:9s}{1000 * cost.tick:4g} ms {calls:7.0f} calls/s  wall {cost.wall_ratio:6.2f}")

    orders = {ground: study_order(Case.physics(ground, m113, named(ground))) for ground in ("asphalt", "lete-sand")}
    for name, order in orders.items():
        for held in order.held:
            print(f"order   {name:10s}{held.label:9s} observed {held.order:.2f}")

    cases = [
        Case.physics(f"{vehicle.name}, {ground}", vehicle, named(ground))
        for vehicle in (m113, ugv)
        for ground in ("asphalt", "lete-sand")
    ] + [Case.physics(f"{flat.name}, asphalt", flat, named("asphalt"))]
    lives = {case.name: study_live(case) for case in cases}
    for name, live in lives.items():
        for label in LABELS:
            vx, vy, yaw_rate = 1000 * live.pooled(label)[0]
            print(f"live    {name:42s}{label:34s}{vx:7.3f} mm/s {vy:7.3f} mm/s {yaw_rate:7.3f} mrad/s at 10 ms")

    chatters = {case.name: study_chatter(case) for case in (asphalt, stiff)}
    for name, rows in chatters.items():
        for row in rows:
            if row.tick in (TICKS[0], TICKS[-1]):
                print(
                    f"chatter {name:28s}{row.maneuver:9s}{row.method:9s}{1000 * row.tick:4g} ms  "
                    f"{row.force_change:9.3g} N {row.moment_change:9.3g} N m {1000 * row.speed_left:9.3g} mm/s"
                )

    # A map's lowest speed stands for rest: V_ε is larger there.
    soft_speeds, speeds = np.geomspace(0.01, 1.0, 81), np.geomspace(0.003, 10.0, 141)
    maps = [map_stability(m113, shear_modulus, soft_speeds, speeds) for shear_modulus in SHEAR_MODULI]
    probes = probe_boundary(m113)
    print(f"map     {sum(probe.agrees for probe in probes)} of {len(probes)} simulated disturbances agree")

    draw_order(orders["asphalt"], lives["m113, asphalt"], costs, m113.tread / 2, figures / "tick-order.png")
    draw_transients(asphalt, stiff, chatters, figures / "tick-transients.png")
    draw_stability(maps, probes, m113.soft_speed, figures / "tick-stability.png")
    write_json(
        output / "results" / "tick.json",
        {
            "command": "python -P benchmarks/tick_study.py --output docs",
            "grouser": grouser.__version__,
            "machine": f"{platform.machine()}, {os.cpu_count()} cores, kernels at {cpu_level()}",
            "methods": list(METHODS),
            "order": order_results(orders),
            "live": live_results(lives),
            "chatter": chatter_results(chatters),
            "cost": cost_results(costs),
            "stability": stability_results(m113, maps, probes),
        },
    )


if __name__ == "__main__":
    main()
