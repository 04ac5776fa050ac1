"""The file under an artifact: named tensors and JSON metadata in one safetensors file, sealed by a hash."""

from __future__ import annotations

import hashlib
import json
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors
from safetensors.numpy import save as save_tensors

from ..terrain import ArtifactError

Tensors = dict[str, NDArray[Any]]
# One key holds everything: safetensors writes several in no fixed order, and equal content must give equal bytes.
_KEY: Final = "grouser"
_HASH: Final = "content_hash"


def content_hash(tensors: Tensors, metadata: dict[str, Any]) -> str:
    """Return the SHA-256 over metadata, and names, types, shapes and bytes of the tensors, in hexadecimal.

    Raises
    ------
    ArtifactError
        If the metadata cannot be held by JSON.
    """
    digest = hashlib.sha256(_to_json(metadata).encode())
    for name in sorted(tensors):
        array = np.asarray(tensors[name], order="C")
        digest.update(f"\n{name} {array.dtype.str} {list(array.shape)}\n".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def pack(tensors: Tensors, metadata: dict[str, Any]) -> bytes:
    """Return the file's bytes; equal content gives equal bytes.

    Raises
    ------
    ArtifactError
        If the metadata cannot be held by JSON.
    """
    sealed = metadata | {_HASH: content_hash(tensors, metadata)}
    return save_tensors({name: np.asarray(a, order="C") for name, a in tensors.items()}, {_KEY: _to_json(sealed)})


def unpack(data: bytes, source: str, newest_version: int) -> tuple[Tensors, dict[str, Any]]:
    """Return tensors and metadata of :func:`pack`, once the hash is seen to fit.

    Parameters
    ----------
    data : bytes
        The file.
    source : str
        Its name, for messages.
    newest_version : int
        Largest ``format_version`` that the caller reads.

    Raises
    ------
    ArtifactError
        If the file is truncated, not safetensors, not grouser's, of a newer format, or altered.
    """
    try:
        tensors = load_tensors(data)
        header = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
    except (SafetensorError, ValueError, KeyError) as error:
        raise ArtifactError(f"artifact {source!r} is truncated or not a safetensors file: {error}") from error
    try:
        metadata = json.loads(header["__metadata__"][_KEY])
        version, stored = metadata["format_version"], metadata.pop(_HASH)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ArtifactError(
            f"artifact {source!r} lacks grouser's metadata ({error}); only what grouser saved can be loaded"
        ) from error
    if version not in range(1, newest_version + 1):
        raise ArtifactError(
            f"artifact {source!r} has format version {version!r}, this grouser reads 1 to {newest_version}; "
            "upgrade grouser, or train the surrogate again"
        )
    if content_hash(tensors, metadata) != stored:
        raise ArtifactError(
            f"artifact {source!r} was altered: its weights or metadata do not fit its content hash "
            f"{str(stored)[:12]}; take a fresh copy or train it again"
        )
    return tensors, metadata


def _to_json(metadata: dict[str, Any]) -> str:
    try:
        return json.dumps(metadata, sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ArtifactError(
            f"an artifact's recipe, metrics and names must be finite numbers, strings, lists or dictionaries: {error}"
        ) from error
