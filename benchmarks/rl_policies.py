"""The shipped policies judged on physics: path tracking beside tuned pure pursuit over 100 starts, parking over 200.

    python -P benchmarks/rl_policies.py --training build/rl/path-tracking --output docs

Pure pursuit is searched on physics, on the same ground and path, over starts that are not judged; its slip parameters
are identified there as well. The policy saw neither physics nor the other grounds and paths. About ten minutes.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

# With -P the folder of a script is not searched, and the package beside it is found from the repository's root.
sys.path.append(str(Path(__file__).resolve().parent.parent))

from benchmarks.rl.figure import tracking_figure
from benchmarks.rl.judgement import PARKING_POLICY, TRACKING_POLICY, comparison, parking, tracking
from benchmarks.rl.results import keep
from grouser.controllers import load_policy
from grouser.controllers.rl import read_curve

TARGETS = {"parking success": 0.95, "tracking": "cross-track RMSE and return better than tuned pure pursuit"}
#: The ground and path that the policy was trained on, and some that it was not.
PLACES = (("asphalt", "iso-3888-1"), ("lete-sand", "iso-3888-1"), ("asphalt", "sine"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--training", type=Path, required=True, help="folder that grouser rl train wrote the policy in")
    parser.add_argument("--output", type=Path, default=Path("build/rl"))
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--parkings", type=int, default=200)
    chosen = parser.parse_args()
    judged: dict[str, Any] = {}
    for terrain, path in PLACES:
        found = tracking(terrain, range(chosen.starts), path)
        judged[f"{terrain}, {path}"] = {"drivers": found, "paired": comparison(found)}
        for name, entry in found.items():
            print(
                f"{terrain:10s} {path:12s} {name:42s} cross-track RMSE {entry['cross_track_rmse']:.4f} m, "
                f"return {entry['return']:.3f}, {entry['seconds']:.1f} s",
                flush=True,
            )
    parked = {terrain: parking(terrain, chosen.parkings) for terrain in ("asphalt", "lete-sand")}
    for terrain, entry in parked.items():
        print(f"{terrain:10s} parked {entry['success_rate']:.3f} {entry['success_interval_95']}", flush=True)
    curve = list(read_curve(chosen.training))
    results = {
        "command": f"python -P benchmarks/rl_policies.py --training {chosen.training} --output docs",
        "units": {"cross_track_rmse": "m, mean over starts", "return": "sum of rewards", "success": "share"},
        "policies": {name: load_policy(name).content_hash for name in (TRACKING_POLICY, PARKING_POLICY)},
        "training": curve,
        "tracking": judged,
        "parking": parked,
        "targets": TARGETS,
    }
    keep(chosen.output, "policies", results)
    first = judged[f"{PLACES[0][0]}, {PLACES[0][1]}"]["drivers"]
    tracking_figure(first, curve, chosen.output / "figures" / "rl-tracking.png")


if __name__ == "__main__":
    main()
