"""The machine's own C compiler, for what is measured against: found, run in a folder that goes again."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import Final, NamedTuple

from ...terrain import ConfigurationError

_COMPILERS: Final = ("gcc", "clang", "cc")
_SECONDS: Final = 120


class Unit(NamedTuple):
    """One C file and the flags that it is compiled with.

    Parameters
    ----------
    source : str
        Its text.
    flags : tuple of str
        For the compiler.
    """

    source: str
    flags: tuple[str, ...]


@dataclass(frozen=True)
class Toolchain:
    """A C compiler.

    Parameters
    ----------
    compiler : str
        What to call.
    version : str
        Name and version in words.
    """

    compiler: str
    version: str

    @classmethod
    def find(cls) -> Toolchain | None:
        """Return ``$CC`` or the first compiler on the search path; None where there is none."""
        for name in (os.environ.get("CC", ""), *_COMPILERS):
            if name and shutil.which(name):
                done = subprocess.run([name, "--version"], capture_output=True, text=True, check=False)
                if done.returncode == 0:
                    return cls(name, done.stdout.splitlines()[0])
        return None

    def library(self, folder: Path, name: str, units: Sequence[Unit]) -> ctypes.CDLL:
        """Compile C files into a library and load it.

        Parameters
        ----------
        folder : Path
            Takes the files.
        name : str
            Of the library, without ending.
        units : sequence of Unit
            What is linked together.

        Raises
        ------
        ConfigurationError
            If the compiler refuses.
        """
        objects = []
        for index, unit in enumerate(units):
            source, target = folder / f"{name}_{index}.c", folder / f"{name}_{index}.o"
            source.write_text(unit.source, encoding="utf-8")
            self._run("-std=gnu11", "-fPIC", *unit.flags, "-c", str(source), "-o", str(target))
            objects.append(str(target))
        library = folder / f"{name}.so"
        # Linked without the flags of the units: -ffast-math would flush denormals in the whole process.
        self._run("-shared", *objects, "-o", str(library), "-lm")
        return ctypes.CDLL(str(library))

    def _run(self, *arguments: str) -> None:
        done = subprocess.run(
            [self.compiler, *arguments], capture_output=True, text=True, check=False, timeout=_SECONDS
        )
        if done.returncode:
            raise ConfigurationError(f"{self.version} refuses: {(done.stderr.strip().splitlines() or ['?'])[0]}")


def core_sources(folder: Path) -> Path:
    """Copy the C core's sources and headers into a folder, and return the place of ``src`` and ``include``.

    Raises
    ------
    ConfigurationError
        If they are not installed.
    """
    place = folder / "core"
    for part in ("src", "include/grouser"):
        try:
            with as_file(files("grouser.native").joinpath(part)) as read:
                sources = [file for file in read.iterdir() if file.suffix in (".c", ".h")]
                (place / part).mkdir(parents=True, exist_ok=True)
                for file in sources:
                    shutil.copy(file, place / part)
        except OSError as error:
            raise ConfigurationError("the C core's sources are not installed") from error
    return place
