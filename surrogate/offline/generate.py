"""Generate a dataset: runs in parallel, each from its own random stream, resumable run by run."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np

from ...envs.rollout import rollout
from ...envs.simulator import Simulator
from ...envs.tick import INTEGRATORS, Integrator
from ...terrain import (
    ArtifactError,
    ConfigurationError,
    ForceBackend,
    InvalidInputError,
    Terrain,
    TrackedVehicle,
    make_backend,
    parameter_ranges,
    resolve_vehicle,
    unknown_name,
    write_json,
)
from .dataset import MANIFEST_NAME, load_dataset, read_manifest, write_dataset
from .engines import Engine, in_parallel, require_engine
from .maneuvers import MANEUVERS, Maneuver, draw_maneuver
from .manifest import Manifest, RunRecord, parse_manifest
from .run_file import Run, write_run

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


def draw_run(recipe: DataConfig | Manifest, vehicle: TrackedVehicle, run: int) -> tuple[Terrain, Maneuver]:
    """Draw terrain and maneuver of one run: a function of the recipe and the run's index alone."""
    generator = np.random.default_rng((recipe.seed, run))
    terrain = parameter_ranges(recipe.ranges, recipe.mode).sample(generator)
    duration = (round(recipe.transient / recipe.tick) + recipe.samples_per_run) * recipe.tick
    return terrain, draw_maneuver(MANEUVERS[run % len(MANEUVERS)], vehicle, generator, duration)


def simulate_run(config: DataConfig, backend: ForceBackend, run: int) -> Run:
    """Simulate one run of a dataset: a function of the configuration and the run's index alone."""
    terrain, maneuver = draw_run(config, backend.vehicle, run)
    skipped = round(config.transient / config.tick)
    duration = (skipped + config.samples_per_run) * config.tick
    simulator = Simulator(backend.vehicle, backend, terrain, tick=config.tick, integrator=config.integrator)
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
    config: DataConfig,
    folder: Path,
    *,
    workers: int = 1,
    engine: Engine = "joblib",
    progress: Progress | None = None,
) -> Manifest:
    """Generate a dataset, or go on with one that was interrupted.

    The bits do not depend on the engine or the number of workers. Each finished run is kept as a file of its own until all are
    there; the manifest is written last.

    Parameters
    ----------
    config : DataConfig
        What to generate.
    folder : Path
        Where to.
    workers : int
        Processes.
    engine : {"joblib", "ray"}
        Who runs them; see :func:`~grouser.surrogate.offline.engines.in_parallel`.
    progress : callable, optional
        Called with the number of finished runs and of all runs.

    Raises
    ------
    ConfigurationError
        If the folder holds another dataset, finished or not, or the engine is unknown or not installed.
    SimulationDivergedError
        If a run diverges; the others are kept.
    WorkerLostError
        If a worker process was killed; finished runs are kept.
    ArtifactError
        If a finished run's file is damaged or of another dataset.
    """
    if workers < 1:
        raise InvalidInputError(f"workers must be at least 1, got {workers}")
    require_engine(engine)
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
    recipe = manifest.recipe_hash
    jobs = [(config, backend, recipe, run, paths[run].resolve()) for run in missing]
    for _ in in_parallel(_one, jobs, workers, engine):
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


def _one(config: DataConfig, backend: ForceBackend, recipe: str, run: int, path: Path) -> int:
    write_run(path, simulate_run(config, backend, run), recipe)
    return run
