"""Draw what a dataset consists of: one run of each maneuver, and where in slip space training rows lie.

    python -P benchmarks/data_figures.py --output docs/figures

It writes ``data-excitation.png`` and ``data-coverage.png``, the same on every machine to rounding.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

# -P keeps this folder off the path. At the end of it, the repository's root shadows nothing.
sys.path.append(str(Path(__file__).resolve().parents[1]))

from benchmarks.data.coverage import RUNS, SAMPLES, draw_coverage, slips_by_source, summary
from benchmarks.data.excitation import draw_excitation
from grouser.terrain import TrackedVehicle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("build/data"))
    output: Path = parser.parse_args().output
    draw_excitation(TrackedVehicle.preset("m113"), "asphalt", output / "data-excitation.png")
    with TemporaryDirectory() as folder:
        slips = slips_by_source("m113", Path(folder) / "rigid")
    for line in summary(slips):
        print(line)
    title = (
        f"M113, rigid ground, wide ranges: both tracks of {RUNS * SAMPLES} logged rows, their copies, and as many more"
    )
    draw_coverage(slips, title, output / "data-coverage.png")


if __name__ == "__main__":
    main()
