"""``grouser doctor``: what is installed, and what it can do."""

from __future__ import annotations

import os
import platform
import re
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.resources import files
from typing import Final

from rich.markup import escape
from rich.table import Table

from ..terrain import OUTPUT_NAMES, GrouserError, backend_names
from ._console import out, print_facts
from ._tables import number, table

_NLP_SOLVERS: Final = ("ipopt", "fatrop", "sqpmethod")
_CONIC_SOLVERS: Final = ("hpipm", "qrqp", "osqp", "daqp")


def doctor() -> None:
    """Say what is installed and what works: versions, kernels, solvers, artifacts, backends, environments.

    Everything optional may be missing; then the line says how to get it. Paste the output into a bug report.
    """
    import gymnasium

    from ..native import cpu_level
    from ..surrogate import shipped_names

    packages = table("Packages", ["package", "version"], text_columns=2)
    for name, value in _packages().items():
        packages.add_row(name, escape(value))
    out.print(packages)
    shipped = shipped_names()
    print_facts(
        {
            "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} CPUs",
            "kernels": cpu_level(),
            "solvers": _solvers(),
            "backends": ", ".join(backend_names()),
            "environments": ", ".join(sorted(name for name in gymnasium.registry if name.startswith("grouser/"))),
            "artifacts": f"{len(shipped)} shipped" if shipped else "none shipped: make one with grouser train",
        }
    )
    if shipped:
        out.print(_artifacts(shipped))


def _packages() -> dict[str, str]:
    """Return versions by package, from grouser's own requirements, or how to get what is missing."""
    found = {"grouser": version("grouser"), "python": platform.python_version()}
    for requirement in requires("grouser") or []:
        match = re.match(r"[\w.-]+", requirement)
        extra = re.search(r"extra == ['\"](\w+)['\"]", requirement)
        if match is None or match[0] == "grouser" or match[0] in found:
            continue
        try:
            found[match[0]] = version(match[0])
        except PackageNotFoundError:
            found[match[0]] = f"missing: pip install 'grouser[{extra[1]}]'" if extra else "missing"
    return found


def _solvers() -> str:
    """Return the CasADi solvers whose libraries load."""
    try:
        import casadi
    except ImportError:
        return "none: CasADi is missing"
    loaded = [name for name in _NLP_SOLVERS if casadi.has_nlpsol(name)]
    loaded += [name for name in _CONIC_SOLVERS if casadi.has_conic(name)]
    missing = [name for name in (*_NLP_SOLVERS, *_CONIC_SOLVERS) if name not in loaded]
    return ", ".join(loaded) + (f" (not: {', '.join(missing)})" if missing else "")


def _artifacts(names: tuple[str, ...]) -> Table:
    from ..surrogate import Surrogate

    made = table(
        "Shipped surrogates",
        ["name", "ranges", "content hash", "family", "hidden", "R² of Qx Qy Mz", "kB"],
        text_columns=5,
    )
    for name in names:
        try:
            surrogate = Surrogate.load(name)
        except GrouserError as error:
            made.add_row(name, f"[red]{escape(str(error))}[/red]")
            continue
        test = surrogate.metrics.get("test", {})
        size = len(files("grouser.surrogate").joinpath("artifacts", f"{name}.safetensors").read_bytes())
        made.add_row(
            name,
            surrogate.range_name,
            surrogate.content_hash[:12],
            "structured" if surrogate.structured else "plain",
            "-".join(map(str, surrogate.network.widths[1:-1])),
            " ".join(number(test[output]["r2"], ".4f") for output in OUTPUT_NAMES) if test else "–",
            f"{size / 1000:.0f}",
        )
    return made
