"""Generate a dataset: runs in parallel, each from its own random stream, resumable run by run."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from ...envs.rollout import rollout
from ...envs.simulator import Simulator
from ...envs.tick import INTEGRATORS, Integrator
from ...terrain import (
    ArtifactError,
    ConfigurationError,
    ForceBackend,
    InvalidInputError,
    make_backend,
    missing_extra,
    parameter_ranges,
    resolve_vehicle,
    unknown_name,
    write_json,
)
from .dataset import MANIFEST_NAME, Run, load_dataset, read_manifest, write_dataset, write_run
from .maneuvers import MANEUVERS, draw_maneuver
from .manifest import Manifest, RunRecord, parse_manifest

PARTS_NAME: Final = "parts"
PLAN_NAME: Final = "plan.json"

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class DataConfig:
    """What to generate.

    Parameters
    ----------
    mode : {"rigid", "soil"}
        Terrain mode.
    vehicle : str
        Preset name or catalogue file.
    ranges : {"wide", "paper"}
        Terrain ranges that runs are drawn from.
    runs : int
        Number of runs; maneuvers take turns.
    samples_per_run : int
        Logged ticks a run; the paper has 3801.
    transient : float
        Discarded start of each run, in s.
    tick : float
        T_s in s.
    integrator : {"implicit", "sdirk2", "euler"}
        Of the simulator.
    teacher : str
        Backend that drives and is logged: ``"physics"``, ``"exact"``, or one that is registered.
    seed : int
        Run i draws from the stream (seed, i).

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If a name is unknown.
    """

    mode: str = "rigid"
    vehicle: str = "m113"
    ranges: str = "wide"
    runs: int = 300
    samples_per_run: int = 3801
    transient: float = 2.0
    tick: float = 0.01
    integrator: Integrator = "implicit"
    teacher: str = "physics"
    seed: int = 0

    def __post_init__(self) -> None:
        parameter_ranges(self.ranges, self.mode)
        resolve_vehicle(self.vehicle)
        if self.integrator not in INTEGRATORS:
            raise unknown_name("integrator", self.integrator, INTEGRATORS)
        for name in ("runs", "samples_per_run"):
            if getattr(self, name) < 1:
                raise InvalidInputError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not 0 <= self.transient <= 1e6 or not 0 < self.tick <= 1 or self.seed < 0:
            raise InvalidInputError("transient must lie in [0, 1e6] s, tick in (0, 1] s, and seed not be negative")


def simulate_run(config: DataConfig, backend: ForceBackend, run: int) -> Run:
    """Simulate one run of a dataset: a function of the configuration and the run's index alone."""
    generator = np.random.default_rng((config.seed, run))
    vehicle = backend.vehicle
    terrain = parameter_ranges(config.ranges, config.mode).sample(generator)
    skipped = round(config.transient / config.tick)
    duration = (skipped + config.samples_per_run) * config.tick
    maneuver = draw_maneuver(MANEUVERS[run % len(MANEUVERS)], vehicle, generator, duration)
    simulator = Simulator(vehicle, backend, terrain, tick=config.tick, integrator=config.integrator)
    log = rollout(simulator, maneuver, duration, control_period=config.tick)
    names = backend.interface.parameter_names
    record = RunRecord(
        run=run,
        maneuver=maneuver.name,
        terrain=dict(zip(names, terrain.parameters.tolist(), strict=True)),
        excitation=maneuver.excitation,
        samples=config.samples_per_run,
        divided_ticks=int(np.sum(log.divisions[skipped:] > 1)),
    )
    return Run(record, log.inputs[skipped:], log.forces[skipped:])


def generate_dataset(
    config: DataConfig, folder: Path, *, workers: int = 1, progress: Progress | None = None
) -> Manifest:
    """Generate a dataset, or go on with one that was interrupted.

    The bits do not depend on the number of workers. Each finished run is kept as a file of its own until all are
    there; the manifest is written last.

    Parameters
    ----------
    config : DataConfig
        What to generate.
    folder : Path
        Where to.
    workers : int
        Processes.
    progress : callable, optional
        Called with the number of finished runs and of all runs.

    Raises
    ------
    ConfigurationError
        If the folder holds another dataset, finished or not.
    SimulationDivergedError
        If a run diverges; the others are kept.
    """
    if workers < 1:
        raise InvalidInputError(f"workers must be at least 1, got {workers}")
    backend = make_backend(config.teacher, mode=config.mode, vehicle=config.vehicle)
    manifest = _plan(config, backend)
    parts = folder / PARTS_NAME
    if (folder / MANIFEST_NAME).exists():
        existing = read_manifest(folder)
        if not existing.same_recipe(manifest):
            raise ConfigurationError(f"{folder} holds another dataset; choose a new folder or remove it")
        load_dataset(folder)
        shutil.rmtree(parts, ignore_errors=True)
        return existing
    _claim(parts, manifest)
    paths = [parts / f"run-{run:06d}.parquet" for run in range(config.runs)]
    missing = [run for run, path in enumerate(paths) if not path.exists()]
    done = config.runs - len(missing)
    if progress:
        progress(done, config.runs)
    for _ in _in_parallel(config, backend, [(run, paths[run]) for run in missing], workers):
        done += 1
        if progress:
            progress(done, config.runs)
    complete = write_dataset(folder, manifest, paths)
    shutil.rmtree(parts)
    return complete


def _plan(config: DataConfig, backend: ForceBackend) -> Manifest:
    return Manifest(
        mode=backend.mode,
        vehicle=backend.vehicle.to_dict(),
        ranges=config.ranges,
        backend=backend.describe(),
        integrator=config.integrator,
        tick=config.tick,
        transient=config.transient,
        samples_per_run=config.samples_per_run,
        runs=config.runs,
        seed=config.seed,
    )


def _claim(parts: Path, manifest: Manifest) -> None:
    """Mark the folder as this dataset's, or see that it already is."""
    plan = parts / PLAN_NAME
    if plan.exists():
        try:
            claimed = parse_manifest(json.loads(plan.read_text(encoding="utf-8")))
        except (ValueError, TypeError) as error:
            raise ArtifactError(f"{plan} is not a dataset's plan; remove {parts} to start anew: {error}") from error
        if not claimed.same_recipe(manifest):
            raise ConfigurationError(
                f"{parts.parent} holds an unfinished dataset of another recipe; choose a new folder or remove it"
            )
        return
    parts.mkdir(parents=True, exist_ok=True)
    write_json(plan, asdict(manifest))


def _one(config: DataConfig, backend: ForceBackend, run: int, path: Path) -> int:
    write_run(path, simulate_run(config, backend, run))
    return run


def _in_parallel(config: DataConfig, backend: ForceBackend, jobs: list[tuple[int, Path]], workers: int) -> Any:
    if workers == 1 or len(jobs) < 2:
        return (_one(config, backend, run, path) for run, path in jobs)
    try:
        from joblib import Parallel, delayed
    except ImportError as error:
        raise missing_extra("joblib", "torch") from error
    parallel = Parallel(n_jobs=workers, return_as="generator_unordered")
    return parallel(delayed(_one)(config, backend, run, path) for run, path in jobs)
