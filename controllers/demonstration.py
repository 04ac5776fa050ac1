"""The whole thread in one call: data, two surrogates, and every driver on every backend."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path as FilePath
from time import perf_counter
from typing import Any, Final

import numpy as np

from ..envs import Driver, Path, make_path
from ..surrogate import Surrogate
from ..surrogate.offline.dataset import load_dataset
from ..surrogate.offline.generate import generate_dataset
from ..surrogate.offline.training import EpochReport, train_surrogate
from ..surrogate.threads import torch_threads
from ..terrain import (
    ArtifactError,
    ConfigurationError,
    Ground,
    Mode,
    Patch,
    Rectangle,
    TrackedVehicle,
    named,
    paint_field,
    write_json,
)
from .comparison import compare, document
from .comparison_row import Drive
from .demonstration_config import DemoConfig
from .mpc import PathTrackingMPC
from .mpc_config import MPCConfig
from .processes import StageProgress, run_in_processes
from .report import write_report
from .rl import Policy, PolicyDriver, load_policy
from .scenario import DriverFactory, Scenario
from .slip_model import identify_slip

# Of the map of the third scenario, in m: how far it reaches around the path, and its cells. Its border between asphalt
# and ice is two cells wide.
_MAP_MARGIN: Final = 10.0
_MAP_SPACING: Final = 0.25

BACKENDS: Final = ("physics", "torch", "native", "guarded")


@dataclass(frozen=True, eq=False)
class Demonstration:
    """What :func:`run_demonstration` leaves behind.

    Parameters
    ----------
    compared : dict
        What ``compare.json`` holds.
    drives : list of Drive
        One a row.
    metrics : dict
        Test metrics of both surrogates, by name and output.
    files : list of Path
        Plots and page.
    """

    compared: dict[str, Any]
    drives: list[Drive]
    metrics: dict[str, Any]
    files: list[FilePath]


def run_demonstration(
    config: DemoConfig, folder: FilePath, *, workers: int = 2, progress: StageProgress | None = None
) -> Demonstration:
    """Make data, train, drive, compare and report, in a folder; finished parts of an earlier call are used again.

    Parameters
    ----------
    config : DemoConfig
        Sizes.
    folder : Path
        Gets ``data/``, ``artifacts/``, ``compare.json``, plots and ``report.html``.
    workers : int
        Processes. The results do not depend on their number.
    progress : callable, optional
        Called as things move on.

    Returns
    -------
    Demonstration

    Raises
    ------
    ConfigurationError
        If the policy is unknown, of another task, vehicle or reference speed, or observes the terrain.
    """
    policy = _policy_that_fits(config)
    tell = progress or (lambda stage, done, total: None)
    began = perf_counter()
    modes: tuple[Mode, ...] = ("rigid", "soil")
    for mode in modes:
        generate_dataset(
            config.data(mode),
            folder / "data" / mode,
            workers=workers,
            progress=lambda done, total, mode=mode: tell(f"data, {mode}", done, total),  # type: ignore[misc]
        )
    vehicle = TrackedVehicle.preset(config.vehicle).name
    artifacts = {mode: folder / "artifacts" / f"{vehicle}-{mode}.safetensors" for mode in modes}
    run_in_processes(_train_surrogate, [(config, mode, folder, artifacts[mode]) for mode in modes], workers, tell)

    scenarios = demo_scenarios(config, artifacts, policy)
    total = sum(len(scenario.drivers) for scenario in scenarios) * len(BACKENDS)
    driven = iter(range(total))
    with torch_threads(1):
        drives = compare(
            scenarios, BACKENDS, seeds=(config.seed,), progress=lambda _: tell("drives", next(driven), total)
        )
    tell("drives", total, total)
    surrogates = {mode: Surrogate.load(path) for mode, path in artifacts.items()}
    metrics = {f"{vehicle} {mode}": surrogate.metrics["test"] for mode, surrogate in surrogates.items()}
    meta = {
        "config": asdict(config),
        "artifacts": {mode: surrogate.content_hash for mode, surrogate in surrogates.items()},
        "policy": policy.content_hash,
        "datasets": {mode: surrogate.dataset_hash for mode, surrogate in surrogates.items()},
        "summary": (
            f"{vehicle} at {config.speed:g} m/s along {config.path}, on asphalt, on LETE sand, and on asphalt "
            f"that is ice (μ 0.1) from x = {config.ice_from:g} m on, which lies outside the rigid surrogate's data. "
            "Start: up to 0.1 m and 0.01 rad off the path, the same for every backend. The MPC on ice is told the slip "
            "parameters of ice; the policy is told nothing of the ground."
        ),
        "times": {"seconds": perf_counter() - began},
    }
    compared = document(drives, meta)
    write_json(folder / "compare.json", compared)
    tell("report", 0, 1)
    files = write_report(folder, compared, drives, scenarios, metrics)
    tell("report", 1, 1)
    return Demonstration(compared, drives, metrics, files)


def demo_scenarios(config: DemoConfig, artifacts: Mapping[Mode, FilePath], policy: Policy) -> list[Scenario]:
    """Return the three drives: asphalt, LETE sand, and asphalt that turns to ice."""
    vehicle = TrackedVehicle.preset(config.vehicle)
    path = make_path(config.path, vehicle)
    asphalt, sand, ice = named("asphalt"), named("lete-sand"), named("ice")
    x, y, _, _ = path.sample(np.linspace(0.0, path.length, 1 + math.ceil(path.length)))
    extent = (x.min() - _MAP_MARGIN, x.max() + _MAP_MARGIN, y.min() - _MAP_MARGIN, y.max() + _MAP_MARGIN)
    patches = [Patch(ice, Rectangle(x_min=config.ice_from))]
    onto_ice = paint_field(asphalt, extent, spacing=_MAP_SPACING, patches=patches, outside="extend")
    return [
        _scenario(config, "asphalt", "asphalt", asphalt, asphalt, vehicle, path, artifacts, policy),
        _scenario(config, "lete-sand", "lete-sand", sand, sand, vehicle, path, artifacts, policy),
        _scenario(config, "onto-ice", "asphalt, then ice", onto_ice, ice, vehicle, path, artifacts, policy),
    ]


def _scenario(
    config: DemoConfig,
    name: str,
    terrain: str,
    ground: Ground,
    slip_ground: Ground,
    vehicle: TrackedVehicle,
    path: Path,
    artifacts: Mapping[Mode, FilePath],
    policy: Policy,
) -> Scenario:
    slip = identify_slip(vehicle, slip_ground, speed=config.speed)

    def mpc() -> Driver:
        return PathTrackingMPC(path, vehicle, slip, MPCConfig(speed=config.speed))

    drivers: dict[str, DriverFactory] = {"mpc": mpc, "policy": lambda: PolicyDriver(policy, path, ground)}
    artifact = {"artifact": artifacts[ground.mode]}
    return Scenario(
        name,
        terrain,
        ground,
        path,
        vehicle,
        config.speed,
        drivers,
        {backend: artifact for backend in BACKENDS if backend != "physics"},
        config.time_limit,
    )


def _policy_that_fits(config: DemoConfig) -> Policy:
    """Return the policy, before minutes are spent on what it is to drive on."""
    policy, vehicle = load_policy(config.policy), TrackedVehicle.preset(config.vehicle)
    path = make_path(config.path, vehicle)
    driver, _ = (PolicyDriver(policy, path, named(terrain)) for terrain in ("asphalt", "lete-sand"))
    if driver.vehicle != vehicle:
        raise ConfigurationError(f"the policy {config.policy} drives {driver.vehicle.name}, asked for {vehicle.name}")
    if driver.config.reference_speed != config.speed:
        raise ConfigurationError(
            f"the policy {config.policy} drives at {driver.config.reference_speed:g} m/s, asked for {config.speed:g}"
        )
    return policy


def _train_surrogate(tell: StageProgress, config: DemoConfig, mode: Mode, folder: FilePath, output: FilePath) -> None:
    dataset = load_dataset(folder / "data" / mode)
    stage, epochs = f"surrogate, {mode}", config.training.epochs
    recipe = asdict(config.training)
    if _is_surrogate_current(output, recipe, dataset.manifest.content_hash):
        tell(stage, epochs, epochs)
        return
    tell(stage, 0, epochs)

    def report(epoch: EpochReport) -> None:
        tell(stage, epoch.epoch, epoch.epochs)

    train_surrogate(dataset, config.training, output, report=report)


def _is_surrogate_current(file: FilePath, recipe: Mapping[str, Any], dataset: str) -> bool:
    """Whether a surrogate of an earlier call is what would be trained now."""
    try:
        made = Surrogate.load(file)
    except ArtifactError:
        return False
    wanted = json.loads(json.dumps(recipe))
    return made.dataset_hash == dataset and all(made.recipe.get(key) == value for key, value in wanted.items())
