"""The paper's runtime figures (its Tables IX and X), beside which ours are set."""

from __future__ import annotations

from typing import Final, NamedTuple


class PaperLatency(NamedTuple):
    """A row of Table IX: one network as a manual MEX function.

    Parameters
    ----------
    network : str
        Its hidden layers.
    rigid, soil : float
        Time a step in s, by terrain mode.
    rigid_ratio, soil_ratio : float
        Speed-up over the paper's own physics.
    """

    network: str
    rigid: float
    rigid_ratio: float
    soil: float
    soil_ratio: float


class PaperBenchmark(NamedTuple):
    """A row of Table X, rigid mode.

    Parameters
    ----------
    name : str
        The benchmark.
    seconds : float
        Time a step in s.
    notes : str
        What the paper says of it.
    ours : tuple
        The nearest figures of ours: what it is called here, section, case and contender.
    """

    name: str
    seconds: float
    notes: str
    ours: tuple[tuple[str, str, str, str], ...]


TABLE_IX: Final = (
    PaperLatency("64x64", 3.64e-6, 6.46, 3.51e-6, 7.10),
    PaperLatency("128x128", 6.28e-6, 3.77, 6.11e-6, 4.02),
    PaperLatency("128x4", 1.04e-5, 2.29, 1.17e-5, 2.07),
    PaperLatency("256x4", 2.76e-5, 0.86, 5.85e-5, 0.41),
)

_PHYSICS: Final = (
    ("physics 16x4, float64 SIMD", "physics_c", "16x4", "float64"),
    ("scalar -O2", "physics_c", "16x4", "float64, scalar -O2"),
)
TABLE_X: Final = (
    PaperBenchmark("physics_loop_cpu", 2.35e-5, "baseline physics", _PHYSICS),
    PaperBenchmark(
        "nn_step_cpu",
        4.32e-4,
        "dlnetwork, step",
        (("128x128, torch eager", "python", "128x128", "torch, eager"),),
    ),
    PaperBenchmark(
        "nn_batch_cpu",
        2.47e-6,
        "dlnetwork, batch",
        (("128x128, torch eager, batch of 256", "batch", "128x128", "torch, eager"),),
    ),
    PaperBenchmark("nn_step_series_cpu", 1.68e-3, "SeriesNetwork, step", ()),
    PaperBenchmark("nn_batch_series_cpu", 1.07e-5, "SeriesNetwork, batch", ()),
    PaperBenchmark(
        "nn_step_mex",
        9.98e-6,
        "manual MEX, step",
        (
            ("128x128", "networks_c", "128x128", "grouser"),
            ("plain C -O2", "networks_c", "128x128", "plain C, -O2"),
        ),
    ),
    PaperBenchmark(
        "nn_batch_mex", 1.97e-6, "manual MEX, batch", (("128x128, batch of 256", "batch", "128x128", "grouser"),)
    ),
)
