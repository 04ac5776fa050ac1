"""``grouser export``: an artifact for worlds without Python."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from ._console import print_facts

export: Final = typer.Typer(help="Export an artifact to worlds without Python.", no_args_is_help=True)


@export.command("c", epilog="Example: grouser export c m113-rigid -o build/m113-rigid-c")
def export_to_c(
    artifact: Annotated[str, typer.Argument(metavar="ARTIFACT", help="Surrogate: a file, or a shipped name.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Gets the files; a folder of its own.")],
    name: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Of files and functions, after grouser_.",
            show_default="the artifact's name or that of its file",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier export in that folder.")] = False,
) -> None:
    """Write a surrogate as C99 for simulators and test rigs: no allocation, no state, nothing but libm.

    One .h and one .c hold the surrogate with its Jacobian, the detector, the guard that switches to the physics by it,
    that physics, and the tick. Beside them: a self-test with golden vectors and a CMakeLists.txt, a Simulink S-function,
    an Unreal component, and a README with the call. The folder is there whole or not at all.
    """
    from ..surrogate import Surrogate, export_c

    surrogate = Surrogate.load(artifact)
    folder = export_c(surrogate, output, name=name or Path(artifact).stem, replace=force)
    (source,) = (file for file in folder.glob("grouser_*.c") if not file.stem.endswith("_sfun"))
    print_facts(
        {
            "sources": f"{source.with_suffix('.h')}, {source.name} ({source.stat().st_size / 1000:.0f} kB)",
            "self-test": f"cc -std=c99 -O2 {folder / 'selftest.c'} {source} -lm -o selftest && ./selftest",
            "read on": folder / "README.md",
            "artifact": surrogate.content_hash,
        }
    )
