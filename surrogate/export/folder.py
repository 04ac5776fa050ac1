"""A folder that is there whole or not at all."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

from ...terrain import InvalidInputError


def write_folder(folder: Path, files: Mapping[str, str], *, replace: bool, own: Iterable[str]) -> Path:
    """Write files into a new folder aside and rename it; return ``folder``.

    Parameters
    ----------
    folder : Path
        Must not exist, or be empty, unless it is to be replaced.
    files : Mapping
        Text by file name.
    replace : bool
        Whether a folder that holds nothing but such files may be replaced.
    own : iterable of str
        Patterns of the names that such files have.

    Raises
    ------
    InvalidInputError
        If something is in the way.
    """
    require_room(folder, replace=replace, own=own)
    folder.parent.mkdir(parents=True, exist_ok=True)
    aside, old = (folder.with_name(f".{folder.name}.{os.getpid()}.{what}") for what in ("new", "old"))
    try:
        aside.mkdir()
        for name, text in files.items():
            aside.joinpath(name).write_text(text, encoding="utf-8", newline="\n")
        if folder.exists():
            folder.rename(old)
        try:
            aside.rename(folder)
        except BaseException:
            if old.exists():
                old.rename(folder)
            raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)
    return folder


def require_room(folder: Path, *, replace: bool, own: Iterable[str]) -> None:
    """Raise unless a folder can be written; arguments and errors as of :func:`write_folder`."""
    if folder.exists() and not folder.is_dir():
        raise InvalidInputError(f"the export goes into a folder of its own; {folder} is a file")
    present = sorted(entry.name for entry in folder.iterdir()) if folder.exists() else []
    if present and not replace:
        raise InvalidInputError(
            f"{folder} is not empty ({len(present)} entries, such as {present[0]}); name a new folder, or replace an "
            "earlier export with --force (replace=True)"
        )
    pattern = re.compile("|".join(own))
    strange = [name for name in present if not pattern.fullmatch(name)]
    if strange:
        raise InvalidInputError(
            f"{folder} holds {', '.join(strange[:3])}, which no export wrote, and would be lost; name another folder"
        )
