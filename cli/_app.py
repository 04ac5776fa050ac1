"""The application: global options, the verbs, and what an error looks like."""

from __future__ import annotations

import errno
from collections.abc import Callable
from importlib.metadata import version
from typing import Annotated, Any, Final

import typer
from rich.text import Text
from typer.core import TyperGroup

from ..terrain import GrouserError
from ._console import err, out
from .bench import bench
from .compare import compare
from .data import data
from .demo import demo
from .doctor import doctor
from .drive import drive
from .evaluate import evaluate
from .export import export
from .ingest import ingest
from .list import listing
from .rl import rl
from .train import train
from .validate import validate
from .verify import verify

_INTERRUPTED: Final = 130
_REFUSED: Final = 2
_DISK_FULL: Final = (errno.ENOSPC, errno.EDQUOT)
#: What a verb keeps when it is interrupted; the others leave nothing behind.
_KEPT: Final = {
    "data": "finished runs are kept; the same command goes on from there",
    "train": "finished epochs are kept; the same command goes on from the last one and ends at the same weights",
    "rl": "checkpoints and trials are kept; rl train goes on with --resume, rl tune with the same command",
    "demo": "finished runs, epochs, surrogates and policies are kept; the same command goes on from there",
}


class _OneLineErrors(TyperGroup):
    """Prints an expected error as one line; here, not in ``main``, so that every way to call the app has it."""

    def invoke(self, ctx: Any) -> Any:
        """Run the verb."""
        try:
            return super().invoke(ctx)
        except (GrouserError, OSError) as error:
            if getattr(error, "errno", None) == errno.EPIPE:
                raise
            if ctx.params["debug"]:
                err.print_exception()
            line = _one_line(error)
            if getattr(error, "errno", None) in _DISK_FULL:
                line = f"the disk is full ({line}); make room: {_kept_by(ctx.invoked_subcommand)}"
            err.print(Text(f"error: {line}", style="bold red"), soft_wrap=True)
            raise typer.Exit(_REFUSED) from error
        except KeyboardInterrupt:
            err.print(f"interrupted: {_kept_by(ctx.invoked_subcommand)}", style="yellow", soft_wrap=True)
            raise typer.Exit(_INTERRUPTED) from None


def _kept_by(verb: str | None) -> str:
    return _KEPT.get(verb or "", "nothing was kept; call it again to start anew")


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())


app = typer.Typer(
    name="grouser",
    cls=_OneLineErrors,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_show_locals=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        out.print(f"grouser {version('grouser')}")
        raise typer.Exit


@app.callback()
def _grouser(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """A testbed for tracked skid-steer vehicles whose ground can be swapped: physics, torch, native or guarded.

    Start with `grouser doctor`, which says what is installed, then `grouser demo`, which does everything once. By
    hand it goes data, train, evaluate; then drive, compare, rl. Each verb explains itself: `grouser train --help`.
    """


_VERBS: Final[tuple[tuple[Callable[..., None], str], ...]] = (
    (demo, "grouser demo --output build/demo"),
    (data, "grouser data build/rigid --mode rigid --runs 300 --workers 2"),
    (ingest, "grouser ingest build/drive-1.npz build/drive-2.npz build/drive-3.npz build/visited"),
    (train, "grouser train build/rigid build/m113-rigid.safetensors --hidden 64,64 --epochs 20"),
    (evaluate, "grouser evaluate build/m113-rigid.safetensors build/rigid"),
    (verify, "grouser verify build/m113-rigid.safetensors --dataset build/rigid"),
    (compare, "grouser compare --terrain asphalt,ice --controller mpc --artifact build/m113-rigid.safetensors"),
    (drive, "grouser drive --terrain lete-sand --controller mpc --backend physics --render build/drive.gif"),
    (validate, "grouser validate --output build/validation"),
    (bench, "grouser bench --output build/bench"),
)
for verb, example in _VERBS:
    app.command(epilog=f"Example: {example}")(verb)
app.add_typer(export, name="export")
app.add_typer(rl, name="rl")
app.add_typer(listing, name="list")
app.command(epilog="Example: grouser doctor")(doctor)


def main() -> None:
    """Run the command line and leave with its exit code."""
    app()
