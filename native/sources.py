"""The C core's own sources, as they are shipped beside the extension."""

from __future__ import annotations

from importlib.resources import files


def read_source(name: str) -> str:
    """Return the text of a C file of the core.

    Parameters
    ----------
    name : str
        Its place under ``native``, such as ``"src/physics.c"`` or ``"include/grouser/physics.h"``.

    Raises
    ------
    FileNotFoundError
        If there is none of that name.
    """
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
