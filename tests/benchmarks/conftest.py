"""The studies lie beside the package: they are found from the repository's root, and absent in a source distribution."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT))


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Leave the tests out where there are no studies."""
    return None if (ROOT / "benchmarks").is_dir() else True


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT
