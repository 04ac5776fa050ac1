"""What the closed loop notices: equal starts on physics, on the float32 network and on each format, paired."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.stats import t as student

from grouser.controllers import (
    Drive,
    PolicyDriver,
    PurePursuit,
    Scenario,
    compare,
    identify_slip,
    load_policy,
)
from grouser.envs import Driver, Path, make_path
from grouser.surrogate import Surrogate
from grouser.terrain import (
    FloatArray,
    ForceBackend,
    Mode,
    RigidTerrain,
    SoilTerrain,
    TrackedVehicle,
    named,
    register_backend,
)

from .backend import RESOLUTIONS, backend
from .formats import FLOAT32, FORMATS

PATH: Final = "iso-3888-1"
SPEED: Final = 5.0
POLICY: Final = "m113-path-tracking"
#: Ground by mode.
GROUNDS: Final[Mapping[Mode, str]] = {"rigid": "asphalt", "soil": "lete-sand"}
CONTROLLERS: Final = ("pure-pursuit", POLICY)
#: A format is noticed beyond this, in m.
MARGIN: Final = 1e-3
LOOSE: Final = ", tick as loose as the force"
REFERENCE: Final = "physics"
POSITION, CROSS_TRACK = "final position from physics", "cross-track RMSE"
POSITION_FROM_FLOAT32, FINISHED, DIVIDED = "final position from float32", "finished", "ticks in parts"
MEASURES: Final = (POSITION, CROSS_TRACK)

#: One number a start, by contender and figure; lengths in m.
Driven = Mapping[str, Mapping[str, Sequence[float]]]


def contenders() -> dict[str, Callable[[Surrogate], ForceBackend]]:
    """Return what makes each backend, by name: all formats but those that differ in the first layer alone.

    Where activations are rounded, the force is a staircase, and the implicit tick has no solution to float32's tolerance where
    it steps. Both ways out are driven: ticks that are asked for as much all the same, and ticks that are asked for no
    more than the force resolves.
    """
    made: dict[str, Callable[[Surrogate], ForceBackend]] = {}
    for name, kind in FORMATS.items():
        if kind.activations == "float32":
            made[name] = partial(backend, kind=kind)
        elif not kind.first:
            made[name] = partial(backend, kind=kind)
            made[name + LOOSE] = partial(backend, kind=kind, resolution=RESOLUTIONS[kind.activations])
    return made


def drive(surrogate: Surrogate, controller: str, starts: int) -> Driven:
    """Drive the lane change from a number of starts on physics and on every contender.

    Parameters
    ----------
    surrogate : Surrogate
        Of the M113.
    controller : {"pure-pursuit", "m113-path-tracking"}
        Who drives.
    starts : int
        Of seeds 0, 1, ...
    """
    made = contenders()
    for name, make in made.items():
        register_backend(name, partial(_built, make))
    vehicle, terrain = surrogate.vehicle, named(GROUNDS[surrogate.mode])
    path = make_path(PATH, vehicle)
    scenario = Scenario(
        name=controller,
        terrain=GROUNDS[surrogate.mode],
        ground=terrain,
        path=path,
        vehicle=vehicle,
        speed=SPEED,
        drivers={controller: _driver(controller, path, vehicle, terrain)},
        backend_options={name: {"artifact": surrogate} for name in made},
    )
    return figures(compare([scenario], list(made), seeds=range(starts)))


def _built(
    make: Callable[[Surrogate], ForceBackend], *, vehicle: TrackedVehicle, mode: Mode, artifact: Surrogate
) -> ForceBackend:
    return make(artifact.require(vehicle, mode))


def _driver(
    controller: str, path: Path, vehicle: TrackedVehicle, terrain: RigidTerrain | SoilTerrain
) -> Callable[[], Driver]:
    if controller == POLICY:
        policy = load_policy(POLICY)
        return lambda: PolicyDriver(policy, path, terrain)
    slip = identify_slip(vehicle, terrain, speed=SPEED)
    return lambda: PurePursuit(path, vehicle, SPEED, slip=slip)


def figures(drives: Sequence[Drive]) -> Driven:
    """Return what the judgement needs of drives on physics and on the contenders, in one order of starts each."""
    by_name: dict[str, list[Drive]] = {}
    for each in drives:
        by_name.setdefault(each.row.backend, []).append(each)
    return {
        name: {
            POSITION: [float(each.row.final_position_difference_m) for each in driven],
            CROSS_TRACK: [each.row.cross_track_rmse_m for each in driven],
            POSITION_FROM_FLOAT32: [
                _apart(each, other) for each, other in zip(driven, by_name[FLOAT32.name], strict=True)
            ],
            FINISHED: [float(each.row.finished) for each in driven],
            DIVIDED: [float(np.mean(each.log.divisions > 1)) for each in driven],
        }
        for name, driven in by_name.items()
    }


def judged(driven: Driven) -> dict[str, dict[str, Any]]:
    """Return what each contender does to the drives of :func:`drive`, paired by start.

    Two figures tell how far a drive is from the one on physics: the distance where the shorter of both ends, and the
    difference of their cross-track RMSE. Their growth is what they are beyond those of float32, on the mean over the
    starts. A contender is *beyond chance* where a growth exceeds half of its 95 % interval, and *noticed* where it does so
    by more than :data:`MARGIN`, or where a drive does not finish that finishes with float32.

    Returns
    -------
    dict
        By contender; lengths in m, shares of 1.
    """
    base = _from_physics(driven, FLOAT32.name)
    found = {}
    for name, values in driven.items():
        if name == REFERENCE:
            continue
        deviations = _from_physics(driven, name)
        growth = {measure: paired(deviations[measure] - base[measure]) for measure in MEASURES}
        surplus = max(each.mean - each.half_interval for each in growth.values())
        lost = any(own < other for own, other in zip(values[FINISHED], driven[FLOAT32.name][FINISHED], strict=True))
        found[name] = {
            "from physics": {measure: float(deviations[measure].mean()) for measure in MEASURES},
            "growth": {measure: each._asdict() for measure, each in growth.items()},
            "from float32": float(np.mean(values[POSITION_FROM_FLOAT32])),
            "finished": float(np.mean(values[FINISHED])),
            "ticks in parts": float(np.mean(values[DIVIDED])),
            "beyond chance": surplus > 0,
            "noticed": surplus > MARGIN or lost,
        }
    return found


class Paired(NamedTuple):
    """A mean of paired differences.

    Parameters
    ----------
    mean, half_interval : float
        And half of its 95 % interval, by Student's t.
    """

    mean: float
    half_interval: float


def paired(differences: FloatArray) -> Paired:
    """Return the mean of paired differences, shape (n,) with n of at least 2, and half of its 95 % interval."""
    count = len(differences)
    factor = float(student.ppf(0.975, count - 1))
    return Paired(float(differences.mean()), factor * float(differences.std(ddof=1)) / count**0.5)


def _from_physics(driven: Driven, name: str) -> dict[str, FloatArray]:
    own, reference = (np.array(driven[each][CROSS_TRACK]) for each in (name, REFERENCE))
    return {POSITION: np.array(driven[name][POSITION]), CROSS_TRACK: np.abs(own - reference)}


def _apart(one: Drive, other: Drive) -> float:
    """Return the distance in m where the shorter of two drives ends."""
    common = min(len(one.log), len(other.log))
    return float(np.hypot(*(one.log.states[common, :2] - other.log.states[common, :2])))
