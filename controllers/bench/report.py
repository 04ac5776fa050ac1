"""What a measurement leaves: ``bench.json``, the page and its pictures, in a folder and in the documentation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...terrain import ConfigurationError, write_aside
from .page import page, sections_of
from .plots import pictures


def write_bench(folder: Path, document: Mapping[str, Any]) -> list[Path]:
    """Write ``bench.json``, ``bench.md`` and the pictures ``bench-*.png``; return the files.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    document : mapping
        Of :func:`run_bench`. Without matplotlib there are no pictures, and the document says so.
    """
    return _write(document, folder / "bench.json", folder / "bench.md", folder)


def write_bench_docs(docs: Path, document: Mapping[str, Any]) -> list[Path]:
    """Write ``bench.md``, ``results/bench.json`` and ``figures/bench-*.png`` of the documentation; return the files.

    Parameters
    ----------
    docs : Path
        Its folder.
    document : mapping
        Of :func:`run_bench`.
    """
    return _write(document, docs / "results" / "bench.json", docs / "bench.md", docs / "figures")


def _write(document: Mapping[str, Any], data: Path, text: Path, pictured: Path) -> list[Path]:
    drawn: dict[str, bytes] = {}
    try:
        drawn = pictures(sections_of(document))
    except ConfigurationError as error:
        document = dict(document) | {"absent": {**document["absent"], "pictures": str(error)}}
    files = [write_aside(pictured / f"bench-{name}.png", picture) for name, picture in drawn.items()]
    # Not sorted: the tables of a page that is made from the file again keep their order.
    files.append(write_aside(data, (json.dumps(document, indent=2, allow_nan=False) + "\n").encode()))
    places = {
        "data": data.relative_to(text.parent).as_posix(),
        "figures": (pictured.relative_to(text.parent) / "bench-").as_posix() if drawn else "",
    }
    files.append(write_aside(text, page(document, **places).encode()))
    return files
