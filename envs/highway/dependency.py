"""The optional package behind the scenes."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ...terrain import missing_extra


def import_highway_env(module: str) -> Any:
    """Return a module of highway-env, such as ``"road.road"``.

    Raises
    ------
    ConfigurationError
        If highway-env is not installed.
    """
    try:
        return import_module(f"highway_env.{module}")
    except ImportError as error:
        raise missing_extra("highway-env", "highway") from error
