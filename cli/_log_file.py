"""An interface log as one NumPy file."""

from __future__ import annotations

import json
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ..envs import STATE_NAMES, InterfaceLog
from ..terrain import ArtifactError, interface


def write_log(file: Path, log: InterfaceLog) -> None:
    """Write a log as ``.npz``, readable without pickle: arrays by name, with the names of their columns."""
    from ..terrain import write_aside

    buffer = BytesIO()
    np.savez_compressed(
        buffer,
        inputs=log.inputs,
        input_names=np.array(log.interface.names),
        forces=log.forces,
        states=log.states,
        state_names=np.array(STATE_NAMES),
        commands=log.commands,
        right_theta=log.right_theta,
        gravity=log.gravity,
        divisions=log.divisions,
        ood_score=log.ood_score,
        fallback_weight=log.fallback_weight,
        switches=np.array(log.switches),
        mode=np.array(log.mode),
        meta=np.array(json.dumps(log.meta, sort_keys=True)),
    )
    write_aside(file, buffer.getvalue())


def read_log(file: Path) -> InterfaceLog:
    """Read a log of :func:`write_log`.

    Raises
    ------
    ArtifactError
        If it is not one, or of other columns than this version's.
    """
    if file.exists() and not zipfile.is_zipfile(file):
        raise ArtifactError(f"{file} is not a log of grouser drive --log: it is no .npz archive")
    try:
        with np.load(file, allow_pickle=False) as archive:
            arrays: dict[str, Any] = {name: archive[name] for name in archive.files}
        mode = interface(str(arrays.pop("mode"))).mode
        names = tuple(arrays.pop("input_names").tolist()), tuple(arrays.pop("state_names").tolist())
        if names != (interface(mode).names, STATE_NAMES):
            raise ValueError(f"its columns are {', '.join(names[0])} and {', '.join(names[1])}")
        meta = json.loads(str(arrays.pop("meta")))
        return InterfaceLog(mode=mode, meta=meta, switches=int(arrays.pop("switches")), **arrays)
    except FileNotFoundError:
        raise
    except (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise ArtifactError(f"{file} is not a log of grouser drive --log: {error}") from error
