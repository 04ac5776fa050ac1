"""The figures of the studies of reinforcement learning, one file for all of them."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import grouser
from grouser.native import cpu_level
from grouser.terrain import write_json


def keep(output: Path, study: str, figures: Mapping[str, Any]) -> None:
    """Write a study's figures into ``results/rl.json``, beside those of the others that are there already."""
    file = output / "results" / "rl.json"
    kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    kept[study] = {
        "version": grouser.__version__,
        "machine": f"{platform.machine()}, 2 cores, kernels at {cpu_level()}",
        **figures,
    }
    write_json(file, kept)
