"""An interface log as one NumPy file."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path

import numpy as np

from ..envs import STATE_NAMES, InterfaceLog


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
