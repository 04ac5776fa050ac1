"""The errors that grouser raises, and the sentence fragments they share."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class GrouserError(Exception):
    """Base of every error that grouser raises on purpose."""


class InvalidInputError(GrouserError, ValueError):
    """An array, number or file does not hold what the callee needs."""


class OffMapError(InvalidInputError):
    """A position lies beyond a map that refuses it."""


class ArtifactError(GrouserError, ValueError):
    """A surrogate artifact or dataset is missing, altered, or made for something else."""


class ConfigurationError(GrouserError, ValueError):
    """A name, key or combination of options does not exist, or an optional package is missing."""


class WorkerLostError(GrouserError, RuntimeError):
    """A worker process ended before its work was done."""


class SimulationDivergedError(GrouserError, RuntimeError):
    """No tick, however small, was solved to tolerance.

    Parameters
    ----------
    message : str
        What happened.
    state : object, optional
        The vehicle state before the tick.

    Attributes
    ----------
    log : object
        The drive up to that tick, where a rollout kept one.
    """

    def __init__(self, message: str, state: object = None) -> None:
        super().__init__(message)
        self.state = state
        self.log: object = None


def unknown_name(kind: str, name: object, known: Iterable[str]) -> ConfigurationError:
    """Build the error for a name that is not registered, with the nearest one that is.

    Parameters
    ----------
    kind : str
        What the name stands for, such as ``"vehicle"``.
    name : object
        The name that came.
    known : iterable of str
        The names that exist.
    """
    choices = sorted(known)
    near = get_close_matches(str(name), choices, n=1, cutoff=0.3)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return ConfigurationError(f"unknown {kind} {name!r}{hint} (known: {', '.join(choices)})")


def missing_extra(package: str, extra: str) -> ConfigurationError:
    """Build the error for an optional package that is not installed."""
    return ConfigurationError(f"this needs the package {package!r}: pip install 'grouser[{extra}]'")
