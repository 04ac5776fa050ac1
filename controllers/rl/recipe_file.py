"""Recipes as YAML: the files that are shipped, and values as they are written there and typed."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import Any

from ...terrain import InvalidInputError, missing_extra, unknown_name


def shipped_recipes() -> tuple[str, ...]:
    """Names of the shipped recipes, algorithm and environment, sorted."""
    folder = files(__package__) / "recipes"
    return tuple(sorted(item.name.removesuffix(".yml") for item in folder.iterdir() if item.name.endswith(".yml")))


def recipe_text(name: str) -> str:
    """Return the YAML file of a shipped recipe.

    Raises
    ------
    ConfigurationError
        If there is none of that name.
    """
    if name not in shipped_recipes():
        raise unknown_name("recipe", name, shipped_recipes())
    return (files(__package__) / "recipes" / f"{name}.yml").read_text(encoding="utf-8")


def read_value(text: str) -> Any:
    """Read a value as a recipe has it: ``3e-4``, ``true``, ``[64, 64]``, ``lin_1e-3``.

    Raises
    ------
    ConfigurationError
        If PyYAML is not installed.
    InvalidInputError
        If it is not YAML.
    """
    return load_yaml(text, text)


def load_yaml(text: str, source: str) -> Any:
    """Read a YAML text, numbers as they are meant.

    Parameters
    ----------
    text, source : str
        The text, and what errors call it.

    Raises
    ------
    ConfigurationError
        If PyYAML is not installed.
    InvalidInputError
        If it is not YAML.
    """
    try:
        import yaml
    except ImportError as error:
        raise missing_extra("pyyaml", "rl") from error
    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise InvalidInputError(f"{source} is not YAML: {error}") from error
    return read_number(content)


def read_number(value: Any) -> Any:
    """Read what YAML 1.1 leaves as text, such as 3e-4, as the number that it is."""
    if isinstance(value, dict):
        return {str(key): read_number(part) for key, part in value.items()}
    if isinstance(value, list):
        return [read_number(part) for part in value]
    if isinstance(value, str) and re.fullmatch(r"[+-]?\d+(\.\d*)?[eE][+-]?\d+", value):
        return float(value)
    return value
