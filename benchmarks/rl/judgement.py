"""What the shipped policies are worth on physics: path tracking beside tuned pure pursuit, and parking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from benchmarks.rl.pursuit import Drives, drive, pursue, tuned
from grouser.controllers import evaluate, load_policy
from grouser.envs import PathTrackingEnv

TRACKING_POLICY: Final = "m113-path-tracking"
PARKING_POLICY: Final = "m113-parking"
#: What the policy is called in figures and tables.
LEARNED: Final = "PPO, trained on native"
# Starts that nothing else is judged on.
_SEARCH_SEEDS: Final = range(100_000, 100_010)


def tracking(terrain: str, seeds: Sequence[int], path: str = "iso-3888-1") -> dict[str, Any]:
    """Return the policy's drives on physics and those of pure pursuit, tuned on the same ground and path.

    Parameters
    ----------
    terrain, path : str
        Where.
    seeds : sequence of int
        Of the starts.
    """
    policy = load_policy(TRACKING_POLICY)
    environment = policy.environment_spec(backend="physics", terrain=terrain, path=path).make()
    task: Any = environment.unwrapped
    if not isinstance(task, PathTrackingEnv):
        raise TypeError(f"{TRACKING_POLICY} is not of path tracking")
    found = {LEARNED: _figures(drive(task, policy, seeds))}
    for name, pursuit in tuned(task, terrain, _SEARCH_SEEDS).items():
        found[name] = _figures(pursue(task, pursuit, seeds)) | {
            "settings": {key: value for key, value in asdict(pursuit.config).items() if np.isfinite(value)},
            "slip": asdict(pursuit.slip),
        }
    environment.close()
    return found


def comparison(found: dict[str, Any]) -> dict[str, Any]:
    """Return in how many starts the policy beats each pure pursuit, and by how much, paired by seed."""
    learned = found[LEARNED]
    compared = {}
    for name, entry in found.items():
        if name == LEARNED:
            continue
        rmse = np.array(entry["cross_track_rmse_of_seeds"]) - np.array(learned["cross_track_rmse_of_seeds"])
        gain = np.array(learned["return_of_seeds"]) - np.array(entry["return_of_seeds"])
        compared[name] = {
            "cross-track RMSE lower in": float(np.mean(rmse > 0)),
            "return higher in": float(np.mean(gain > 0)),
            "cross-track RMSE lower by": _interval(rmse),
            "return higher by": _interval(gain),
        }
    return compared


def parking(terrain: str, episodes: int) -> dict[str, Any]:
    """Return what the parking policy does on physics.

    Parameters
    ----------
    terrain : str
        Where.
    episodes : int
        Starts, of seeds 0, 1, ...
    """
    policy = load_policy(PARKING_POLICY)
    return evaluate(policy, policy.environment_spec(backend="physics", terrain=terrain), episodes=episodes).summary()


def _figures(driven: Drives) -> dict[str, Any]:
    return {
        "cross_track_rmse": float(driven.cross_track_rmse.mean()),
        "return": float(driven.returns.mean()),
        "seconds": float(driven.lengths.mean()) / 10,
        "cross_track_rmse_of_seeds": driven.cross_track_rmse.tolist(),
        "return_of_seeds": driven.returns.tolist(),
    }


def _interval(differences: np.ndarray) -> dict[str, float]:
    half = 1.96 * float(differences.std(ddof=1)) / np.sqrt(len(differences))
    return {"mean": float(differences.mean()), "half of the 95 % interval": float(half)}
