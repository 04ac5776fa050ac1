"""``grouser rl``: train, judge, film, record and tune policies."""

from __future__ import annotations

import typer

from .evaluate import evaluate
from .recipes import recipes
from .record import record
from .train import train
from .tune import tune
from .video import video

rl = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Train a policy on any backend, and judge, film and record it on any other.",
)

rl.command(epilog="Example: grouser rl train path-tracking --backend native --eval-backend physics -o build/ppo")(train)
rl.command("eval", epilog="Example: grouser rl eval build/ppo/best.safetensors --backend physics --episodes 100")(
    evaluate
)
rl.command(epilog="Example: grouser rl video build/ppo/best.safetensors -o build/ppo.mp4")(video)
rl.command(
    epilog="Example: grouser rl record build/ppo/best.safetensors -o grouser/path-tracking/ppo-v0 --root build/minari"
)(record)
rl.command(epilog="Example: grouser rl tune path-tracking --algo ppo --steps 500000 --trials 50 -o build/tune")(tune)
rl.command(epilog="Example: grouser rl recipes ppo-path-tracking > mine.yml")(recipes)

__all__ = ["rl"]
