"""The policies that grouser ships, by name, and the hashes that they must have."""

from __future__ import annotations

from importlib.resources import files
from typing import Final

from ...terrain import ArtifactError

# A seal in the file tells that it is whole; these tell that it is the one. Whoever replaces a file replaces its hash.
_CONTENT_HASHES: Final = {
    "m113-parking": "86fae9f37a89550e0b45345d85062b9a7e24f27c764705dd03af73b4485e1604",
    "m113-path-tracking": "8e3614a2a765f17b7430116771453d265abff330e0c934922979d7e4cc8d97c2",
}


def shipped_policies() -> tuple[str, ...]:
    """Names of the policies that grouser ships, sorted: ``{vehicle}-{environment}``."""
    return tuple(sorted(_CONTENT_HASHES))


def read_shipped(name: str) -> bytes:
    """Return the file of a shipped policy.

    Raises
    ------
    ArtifactError
        If the installation lacks it.
    """
    try:
        return files(__package__).joinpath("policies", f"{name}.safetensors").read_bytes()
    except OSError as error:
        raise ArtifactError(
            f"cannot read the shipped policy {name!r}, install grouser anew: {error.strerror}"
        ) from error


def require_shipped(name: str, content_hash: str) -> None:
    """Check that a policy is the one that was shipped under a name.

    Raises
    ------
    ArtifactError
        If it is another.
    """
    if content_hash != _CONTENT_HASHES[name]:
        raise ArtifactError(
            f"{name}.safetensors is not the policy that grouser ships: content hash {content_hash}, "
            f"expected {_CONTENT_HASHES[name]}"
        )
