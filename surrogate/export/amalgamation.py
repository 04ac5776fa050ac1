"""Several C files and their headers as one text: each header once, every symbol static."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from posixpath import dirname, join, normpath
from typing import Final

from ...terrain import ConfigurationError

_INCLUDE: Final = re.compile(r'^#include\s+([<"])([^>"]+)[>"].*$')
_GUARD: Final = re.compile(
    r"\A(?P<top>(?:/\*.*?\*/\s*)?)#ifndef (?P<name>\w+)\n#define (?P=name)\n(?P<body>.*)#endif\s*\Z", re.DOTALL
)
#: A declaration or definition at file scope of a function that other files may call.
_FUNCTION: Final = re.compile(
    r"^(?!static\b|typedef\b|extern\b|return\b)(?=[a-z][\w \t*]*\bgrouser_\w+\()", re.MULTILINE
)
_INCLUDE_FOLDER: Final = "include"


class Amalgamation:
    """Collects C files into one text.

    Parameters
    ----------
    read : callable
        From a file's place under ``native`` to its text.
    linkage : str
        What stands before declarations of functions that are to be static.
    dropped : str
        Pattern of text that is left out.
    """

    def __init__(self, read: Callable[[str], str], linkage: str = "", dropped: str = "") -> None:
        self._read = read
        self._linkage = re.compile(rf"^{re.escape(linkage)}", re.MULTILINE)
        self._dropped = re.compile(dropped)
        self._seen: set[str] = set()
        self._system: set[str] = set()
        self._parts: list[str] = []

    def add(self, names: Sequence[str]) -> None:
        """Append files, the headers that they include before them.

        Raises
        ------
        ConfigurationError
            If a file is not there.
        """
        for name in names:
            self._append(name)

    @property
    def system_headers(self) -> tuple[str, ...]:
        """Headers of the C library that the files include, sorted."""
        return tuple(sorted(self._system))

    @property
    def text(self) -> str:
        """The files so far, without the system headers."""
        return "\n".join(self._parts)

    def _append(self, name: str) -> None:
        if name in self._seen:
            return
        self._seen.add(name)
        body = self._dropped.sub("", _without_guard(self._source(name)))
        lines, depth = [], 0
        for line in self._linkage.sub("", body).splitlines():
            include = _INCLUDE.match(line)
            depth += line.startswith("#if") - line.startswith("#endif")
            # What is included on a condition stays where it is.
            if include is None or depth:
                lines.append(line)
            elif include[1] == "<":
                self._system.add(include[2])
            else:
                self._append(self._resolved(include[2], name))
        text = _FUNCTION.sub("static ", "\n".join(lines).strip("\n"))
        if text:
            self._parts.append(f"/* ---- {name} ---- */\n{text}\n")

    def _source(self, name: str) -> str:
        try:
            return self._read(name)
        except OSError as error:
            raise ConfigurationError(
                f"the export puts the C core's sources together and misses native/{name}; install grouser again"
            ) from error

    def _resolved(self, include: str, name: str) -> str:
        beside = normpath(join(dirname(name), include))
        for place in (beside, join(_INCLUDE_FOLDER, include)):
            if place in self._seen:
                return place
            try:
                self._read(place)
            except OSError:
                continue
            return place
        raise ConfigurationError(f'native/{name} includes "{include}", which is not among the installed C sources')


def _without_guard(text: str) -> str:
    guarded = _GUARD.match(text)
    return text if guarded is None else guarded["top"] + guarded["body"]
