"""The optional package that reads and writes Parquet files, and what its failures mean."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...terrain import ArtifactError, missing_extra


def read_parquet(read: Callable[[], Any], path: Path) -> Any:
    """Return what ``read`` gets from a file.

    Raises
    ------
    ArtifactError
        If the file is missing or not whole.
    ConfigurationError
        If pyarrow is not installed.
    """
    import_parquet()
    import pyarrow

    try:
        return read()
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        raise ArtifactError(f"{path} is missing or not a whole Parquet file: {error}") from error


def import_parquet() -> Any:
    """Return the module ``pyarrow.parquet``.

    Raises
    ------
    ConfigurationError
        If pyarrow is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise missing_extra("pyarrow", "torch") from error
    return pyarrow.parquet
