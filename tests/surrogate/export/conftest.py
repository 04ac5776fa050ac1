"""Shipped artifacts, exported and compiled once a session."""

from collections.abc import Callable

import numpy as np
import pytest
from exported import GCC, WARNINGS, Exported, compiled

from grouser.surrogate import Surrogate, export_c
from grouser.terrain import FloatArray

#: A structured one on firm ground, one on soil, and a plain one.
ARTIFACTS = ("m113-rigid", "ugv-soil", "m113-rigid-paper-recipe")


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Exported]:
    if GCC is None:
        pytest.skip("there is no gcc to compile the export with")
    made: dict[str, Exported] = {}

    def make(artifact: str) -> Exported:
        if artifact not in made:
            folder = tmp_path_factory.mktemp("export") / artifact
            name, surrogate = artifact.replace("-", "_"), Surrogate.load(artifact)
            export_c(surrogate, folder, name=name)
            library = folder.parent / f"{artifact}.so"
            flags = ("-std=c99", "-O2", *WARNINGS)
            compiled([GCC, *flags, "-shared", "-fPIC", "-o", library, f"grouser_{name}.c", "-lm"], folder)
            made[artifact] = Exported(folder, name, library, surrogate.interface.size)
        return made[artifact]

    return make


@pytest.fixture(params=ARTIFACTS)
def artifact(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def surrogate(artifact: str) -> Surrogate:
    return Surrogate.load(artifact)


@pytest.fixture
def code(exported: Callable[[str], Exported], artifact: str) -> Exported:
    return exported(artifact)


@pytest.fixture
def rows(surrogate: Surrogate) -> FloatArray:
    """200 rows from all over the box, half of them near rolling."""
    generator, detector = np.random.default_rng(7), surrogate.detector
    x = generator.uniform(detector.low, detector.high, (200, len(detector.low)))
    half, tread = x[:100], surrogate.vehicle.tread
    half[:, 0] = (half[:, 5] + half[:, 6]) / 2 + generator.normal(0.0, 0.2, 100)
    half[:, 1] = generator.normal(0.0, 0.2, 100)
    half[:, 2] = (half[:, 6] - half[:, 5]) / tread + generator.normal(0.0, 0.1, 100)
    return x
