"""Single samples in C: the prototypes beside the project's own kernel, each call waiting for the last."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from grouser.controllers.bench import Contender, Effort, Section
from grouser.controllers.bench.absences import Absences
from grouser.controllers.bench.limits import products
from grouser.controllers.bench.subjects import NETWORKS, Subjects
from grouser.controllers.bench.timing import Burst, measure
from grouser.controllers.bench.toolchain import Toolchain
from grouser.surrogate import NUMPY_NETWORK, DenseNetwork, NativeSurrogate, Surrogate
from grouser.terrain import FloatArray, TrackedVehicle

from .prototypes import AVX512, PROTOTYPES, Prototype, processor

OURS: Final = "grouser"
DRAWN: Final = ("64x64", "128x128", "128x4", "256x4")
SILENT: Final = 0.5
_ROWS: Final = 256
# Multiply-adds in a turn, about .3 ms: short, so that few turns are interrupted where others share the core.
_BURST: Final = 10_000_000


@dataclass(frozen=True, eq=False)
class Subject:
    """A network and the rows that it is timed on.

    Parameters
    ----------
    name : str
        In tables.
    surrogate : Surrogate
        Plain, with ReLU.
    rows : ndarray, shape (256, d)
        In turn.
    """

    name: str
    surrogate: Surrogate
    rows: FloatArray

    @property
    def silence(self) -> list[float]:
        """Share of the units that are silent, by hidden layer, on the mean over the rows."""
        values = hidden_values(self.surrogate.network, self.surrogate.input_normalizer.normalize(self.rows))
        return [float(np.mean(layer == 0)) for layer in values]


def drawn_subjects(names: Sequence[str] = DRAWN, silent: float = SILENT) -> list[Subject]:
    """Return drawn networks of which every hidden unit is silent on a share of the rows of a drive on asphalt."""
    subjects = Subjects(TrackedVehicle.preset("m113"))
    made = []
    for name in names:
        surrogate = subjects.plain(NETWORKS[name])
        z = surrogate.input_normalizer.normalize(subjects.rows)
        network = silenced(surrogate.network, z, silent)
        made.append(Subject(name, replace(surrogate, network=network), subjects.rows))
    return made


def shipped_subject(name: str, rows: FloatArray) -> Subject:
    """Return a shipped plain network on rows of its own, shape (n, d), of which 256 are taken evenly."""
    surrogate = Surrogate.load(name)
    chosen = np.ascontiguousarray(rows[:: max(1, len(rows) // _ROWS)][:_ROWS])
    hidden = surrogate.network.widths[1:-1]
    return Subject(f"{hidden[0]}x{len(hidden)}, {name}", surrogate, chosen)


def silenced(network: DenseNetwork, z: FloatArray, silent: float) -> DenseNetwork:
    """Return the network with biases by which every hidden unit is silent on a share of the rows z, shape (n, inputs)."""
    weights, biases = list(network.weights), list(network.biases)
    for layer in range(len(weights) - 1):
        biases[layer] = np.zeros_like(biases[layer])
        linear = DenseNetwork("relu", tuple(weights[: layer + 1]), tuple(biases[: layer + 1]))
        biases[layer] = -np.quantile(linear.forward(NUMPY_NETWORK, z), silent, axis=0).astype(np.float32)
    return DenseNetwork("relu", tuple(weights), tuple(biases))


def hidden_values(network: DenseNetwork, z: FloatArray) -> list[FloatArray]:
    """Return what every hidden layer of a ReLU network answers to rows z, shape (n, inputs)."""
    return [
        np.maximum(DenseNetwork("relu", network.weights[:count], network.biases[:count]).forward(NUMPY_NETWORK, z), 0.0)
        for count in range(1, len(network.weights))
    ]


def speed(
    subjects: Sequence[Subject], rounds: int, folder: Path, progress: Callable[[int, int], None]
) -> dict[str, Any]:
    """Time every prototype and the project's own kernel on every network.

    Parameters
    ----------
    subjects : sequence of Subject
        Networks.
    rounds : int
        In which everyone has a turn.
    folder : Path
        Takes what is compiled.
    progress : callable
        Called with the rounds done and their number.

    Returns
    -------
    dict
        ``ns``, medians over the rounds, ``bytes`` of weights, scales and biases, and the share of ``silent`` units by
        hidden layer, all by network; the interquartile ``spread`` of the rounds over their median; what is ``absent``,
        and why; the ``compiler``.
    """
    absent = Absences()
    toolchain = Toolchain.find()
    usable = _usable(toolchain, folder, absent)
    section = Section("ns", "One sample in C, each call waiting for the last.")
    contenders, sizes = [], dict[str, dict[str, int]]()
    for index, subject in enumerate(subjects):
        own = NativeSurrogate(subject.surrogate.vehicle, subject.surrogate.mode, subject.surrogate)
        contenders.append(Contender(subject.name, OURS, _turn(subject, _in_c(own, subject.rows))))
        sizes[subject.name] = {}
        for prototype in usable:
            if toolchain is None:
                continue
            with absent.noting(prototype.name):
                compiled = prototype.compile(toolchain, folder, str(index), subject.surrogate)
                contenders.append(Contender(subject.name, prototype.name, _turn(subject, compiled.burst(subject.rows))))
                sizes[subject.name][prototype.name] = compiled.bytes
    measure(section, contenders, Effort(rounds, 0.0), progress)
    return {
        "ns": section.figures,
        "spread": section.spread,
        "bytes": sizes,
        "silent": {subject.name: subject.silence for subject in subjects},
        "absent": dict(absent),
        "compiler": None if toolchain is None else toolchain.version,
    }


def _usable(toolchain: Toolchain | None, folder: Path, absent: Absences) -> list[Prototype]:
    """Return the prototypes that this machine can run, and note what it lacks for the others."""
    if toolchain is None:
        absent["prototypes in C"] = "no C compiler: set CC, or install gcc or clang"
        return []
    has: frozenset[str] = frozenset()
    with absent.noting("prototypes in C"):
        has = processor(toolchain, folder)
    for prototype in PROTOTYPES:
        if prototype.needs not in has:
            absent.setdefault(prototype.name, f"the processor has no {prototype.needs}")
    return [prototype for prototype in PROTOTYPES if {prototype.needs, AVX512} <= has]


def _turn(subject: Subject, burst: Burst) -> Burst:
    """Return a burst of so many calls as the network's size allows, whatever it is asked for."""
    calls = max(8, _BURST // products(subject.surrogate.network.widths))
    return lambda _: burst(calls)


def _in_c(backend: NativeSurrogate, rows: FloatArray) -> Burst:
    return lambda calls: backend.kernel.time_calls(rows, calls, False)
