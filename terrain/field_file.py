"""A terrain field as one ``.npz`` file."""

from __future__ import annotations

import os
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np

from .errors import GrouserError, InvalidInputError, unknown_name
from .field import TerrainField
from .files import write_aside
from .interface import FloatArray, interface

FIELD_SUFFIX: Final = ".npz"
_REQUIRED: Final = ("mode", "origin", "spacing", "parameter_names", "parameters")
_OPTIONAL: Final = ("elevation", "outside")


def save_field(field: TerrainField, file: str | os.PathLike[str]) -> Path:
    """Write a field as ``.npz``, readable without pickle: its fields by name, and the names of θ; return the file."""
    arrays: dict[str, Any] = {
        "mode": np.array(field.mode),
        "origin": np.array(field.origin),
        "spacing": np.array(field.spacing),
        "parameter_names": np.array(interface(field.mode).parameter_names),
        "parameters": field.parameters,
        "outside": np.array(field.outside),
    }
    if field.elevation is not None:
        arrays["elevation"] = field.elevation
    buffer = BytesIO()
    np.savez_compressed(buffer, **arrays)
    return write_aside(Path(file), buffer.getvalue())


def load_field(file: str | os.PathLike[str]) -> TerrainField:
    """Read a field from ``.npz``.

    Raises
    ------
    InvalidInputError
        If the file cannot be read or does not hold a field; the message names it.
    """
    try:
        data = Path(file).read_bytes()
    except OSError as error:
        raise InvalidInputError(f"cannot read the terrain field {file}: {error.strerror or error}") from error
    try:
        with zipfile.ZipFile(BytesIO(data)):
            archive = np.load(BytesIO(data), allow_pickle=False)
        arrays = {name: archive[name] for name in archive.files}
    # NumPy's and zip's readers raise whatever a damaged byte leads them into, from zlib's error to a tokenizer's.
    except Exception as error:
        raise InvalidInputError(f"{file} is not an .npz file of plain arrays: {error}") from error
    try:
        return _field(arrays)
    except (GrouserError, ValueError, TypeError) as error:
        raise InvalidInputError(f"{file} is not a terrain field: {error}") from error


def _field(arrays: dict[str, FloatArray]) -> TerrainField:
    for name in arrays:
        if name not in _REQUIRED + _OPTIONAL:
            raise unknown_name("array of a terrain field", name, _REQUIRED + _OPTIONAL)
    missing = [name for name in _REQUIRED if name not in arrays]
    if missing:
        raise InvalidInputError(f"it lacks {', '.join(missing)}")
    mode = interface(str(arrays["mode"])).mode
    names = tuple(str(name) for name in arrays["parameter_names"])
    if names != interface(mode).parameter_names:
        raise InvalidInputError(
            f"the parameters of a {mode} field are {', '.join(interface(mode).parameter_names)}, got {', '.join(names)}"
        )
    x, y = arrays["origin"].tolist()
    return TerrainField(
        mode,
        (float(x), float(y)),
        float(arrays["spacing"]),
        arrays["parameters"],
        arrays.get("elevation"),
        str(arrays.get("outside", "refuse")),  # type: ignore[arg-type]  # the constructor checks the rule
    )
