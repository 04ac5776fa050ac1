"""Writing files so that none is ever half written under its final name."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write_aside(target: Path, data: bytes) -> Path:
    """Write a file beside its place, then rename it there; return ``target``."""
    target.parent.mkdir(parents=True, exist_ok=True)
    aside = target.with_name(f".{target.name}.{os.getpid()}-{threading.get_ident()}")
    try:
        aside.write_bytes(data)
        aside.replace(target)
    finally:
        aside.unlink(missing_ok=True)
    return target


def write_json(target: Path, content: Mapping[str, Any]) -> Path:
    """Write JSON aside and rename it; numbers are finite, keys sorted. Return ``target``."""
    return write_aside(target, (json.dumps(content, indent=2, sort_keys=True, allow_nan=False) + "\n").encode())
