"""The stand-alone C export: one artifact, its guard, its fallback and the tick, as C99 without dependencies."""

from __future__ import annotations

import os
import re
from importlib.metadata import distribution, version
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Final

from ...native.sources import read_source
from ...terrain import ConfigurationError, PhysicsBackend, SwitchingPolicy
from ..artifact import Surrogate
from ..backends import NativeSurrogate
from . import core
from .amalgamation import Amalgamation
from .declarations import take_type, with_limits, without_unused
from .folder import require_room, write_folder
from .literals import braced, double
from .model import kernel_values, physics_fallback, physics_table, surrogate_tables
from .self_test import self_test_values

#: Version of the exported functions and types.
ABI_VERSION: Final = 1
_NAME: Final = re.compile(r"[a-z][a-z0-9_]{0,62}")
_OWN_FILES: Final = (
    r"grouser_[a-z][a-z0-9_]*\.[ch]",
    r"Grouser\w+Component\.(h|cpp)",
    r"selftest\.c",
    r"CMakeLists\.txt",
    r"README\.md",
    "LICENSE",
)
# Stand for the export's own prefix until the core's names have theirs.
_OWN: Final = "@own@"
_OWN_UPPER: Final = "@OWN@"
_TABLES: Final = "/* ---- the artifact ---- */"


def export_c(
    surrogate: Surrogate,
    folder: str | os.PathLike[str],
    *,
    name: str | None = None,
    policy: SwitchingPolicy | None = None,
    replace: bool = False,
) -> Path:
    """Write a surrogate as C99 sources that need nothing but the C library's mathematics; return the folder.

    The surrogate with its normalizers and Jacobian, the detector and the guard that switches by it, the physics that it
    falls back on, the tick, and a self-test with golden vectors. The same artifact gives the same bytes.

    Parameters
    ----------
    surrogate : Surrogate
        What to export.
    folder : str or path-like
        Is made, whole or not at all.
    name : str, optional
        Of files and functions, after ``grouser_``; vehicle and mode by default, such as ``"m113_rigid"``.
    policy : SwitchingPolicy, optional
        Of the guard.
    replace : bool
        Whether an earlier export in the folder may be replaced.

    Raises
    ------
    ConfigurationError
        If the C core cannot hold the network or the fallback, or the name is none in C.
    InvalidInputError
        If something is in the folder's place.
    """
    chosen = _checked_name(f"{surrogate.vehicle.name}_{surrogate.mode}" if name is None else name)
    require_room(Path(folder), replace=replace, own=_OWN_FILES)
    written = c_files(surrogate, chosen, policy or SwitchingPolicy())
    return write_folder(Path(folder), written, replace=replace, own=_OWN_FILES)


def c_files(surrogate: Surrogate, name: str, policy: SwitchingPolicy) -> dict[str, str]:
    """Return the texts of an export by file name; arguments and errors as of :func:`export_c`."""
    # What the compiled backend refuses, its sources cannot hold either.
    NativeSurrogate(surrogate.vehicle, surrogate.mode, surrogate)
    fallback = physics_fallback(surrogate)
    prefix, component = f"grouser_{name}", f"Grouser{_camel(name)}Component"
    types, remaining = _public_types()
    header, source = _header(surrogate, types), _source(surrogate, fallback, policy, remaining)
    own = {"name": _OWN, "upper": _OWN_UPPER, "component": component, **_facts(surrogate, fallback)}
    texts = {
        f"{prefix}.h": header,
        f"{prefix}.c": _filled("banner.c", own) + source,
        f"{prefix}_sfun.c": _filled("sfun.c", own),
        f"{component}.h": _filled("component.h", own),
        f"{component}.cpp": _filled("component.cpp", own),
        "selftest.c": _filled("selftest.c", own),
        "CMakeLists.txt": _filled("CMakeLists.txt", own),
        "README.md": _filled("README.md", own),
        "LICENSE": _license(),
    }
    return {file: _prefixed(text, name) for file, text in texts.items()}


def _checked_name(name: str) -> str:
    usable = re.sub(r"[-. ]", "_", name.lower())
    if not _NAME.fullmatch(usable):
        raise ConfigurationError(
            f"the name of an export becomes part of C names: letters, digits and underscores, a letter first; "
            f"got {name!r}, choose another with --name (name=)"
        )
    return usable


def _camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


def _prefixed(text: str, name: str) -> str:
    """Put the export's name into every name of the core, so that several exports fit into one program."""
    for core_prefix, own, prefix in (
        ("grouser_", _OWN, f"grouser_{name}"),
        ("GROUSER_", _OWN_UPPER, f"GROUSER_{name.upper()}"),
    ):
        text = re.sub(rf"\b{core_prefix}(?=[A-Za-z])", f"{prefix}_", text).replace(own, prefix)
    return text


def _public_types() -> tuple[str, dict[str, str]]:
    """Return the declarations that the public header shows, and the headers of the core without them."""
    declarations, remaining = [], {}
    for place, keys in core.PUBLIC_TYPES:
        text = read_source(place)
        for key in keys:
            declaration, text = take_type(text, key)
            declarations.append(declaration)
        remaining[place] = text
    return "\n".join(declarations), remaining


def _header(surrogate: Surrogate, types: str) -> str:
    table = surrogate.interface
    names = [name.upper() for name in table.parameter_names]
    enumerators = [f"GROUSER_{names[0]} = GROUSER_TERRAIN", *(f"GROUSER_{name}" for name in names[1:])]
    return _filled(
        "api.h",
        {
            "title": f"Track-terrain forces of the {surrogate.vehicle.name} on {surrogate.mode} ground.",
            "version": version("grouser"),
            "hash": surrogate.content_hash,
            "abi": str(ABI_VERSION),
            "columns": str(table.size),
            "parameters": str(len(names)),
            "types": types,
            "table": "\n".join(f" *   {c.name:<9} {c.unit:<6} {c.meaning}" for c in table.inputs),
            "enumerators": ", ".join(enumerators),
            "maximum_speed": double(surrogate.vehicle.maximum_speed),
        },
    )


def _source(surrogate: Surrogate, fallback: PhysicsBackend, policy: SwitchingPolicy, remaining: dict[str, str]) -> str:
    exact = fallback.grid.path == "exact"
    merged = Amalgamation(
        lambda place: remaining.get(place) or read_source(place), core.LINKAGE, core.LINKAGE_DEFINITION
    )
    merged.add(core.core_files(structured=surrogate.structured, exact=exact))
    names = braced([f'"{name}"' for name in surrogate.interface.names])
    limits = core.limits(surrogate.network.widths, surrogate.vehicle.road_wheels)
    code = [
        core.preamble(exact=exact),
        with_limits(merged.text, limits),
        _TABLES,
        _filled("kernels.c", kernel_values(read_source, surrogate, fallback, policy)),
        _filled("api.c", {"hash": surrogate.content_hash, "names": names}),
        _filled("checks.c", self_test_values(surrogate, fallback, policy)),
    ]
    headers = sorted({*merged.system_headers, "math.h", "stddef.h", "string.h"})
    includes = "".join(f"#include <{header}>\n" for header in headers)
    tables = physics_table(read_source, fallback) + surrogate_tables(read_source, surrogate)
    # The tables are long and use nothing: they come in after the search.
    return f"{includes}\n" + _squeezed(without_unused("\n".join(code))).replace(_TABLES, f"{_TABLES}\n{tables}")


def _license() -> str:
    text = distribution("grouser").read_text("licenses/LICENSE")
    if text is None:
        raise ConfigurationError("an export carries grouser's LICENSE, which is not installed; install grouser again")
    return text


def _squeezed(text: str) -> str:
    return re.sub(r"\n{3,}", "\n\n", text)


def _facts(surrogate: Surrogate, fallback: PhysicsBackend) -> dict[str, str]:
    grid = fallback.grid
    return {
        "vehicle": surrogate.vehicle.name,
        "mode": surrogate.mode,
        "hash": surrogate.content_hash,
        "version": version("grouser"),
        "family": "structured" if surrogate.structured else "plain",
        "layers": "-".join(map(str, surrogate.network.widths)),
        "activation": surrogate.network.activation,
        "parameters": str(surrogate.network.parameter_count),
        "fallback": f"{fallback.name}, {grid.along} x {grid.across} cells an element, {grid.contact} contact",
        "columns": ", ".join(surrogate.interface.names),
        "abi": str(ABI_VERSION),
        "parameter_columns": ", ".join(surrogate.interface.parameter_names),
    }


def _filled(template: str, values: dict[str, str]) -> str:
    text = files(__package__).joinpath("templates", template).read_text(encoding="utf-8")
    return Template(text).substitute(values)
