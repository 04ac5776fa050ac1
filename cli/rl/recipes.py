"""``grouser rl recipes``."""

from __future__ import annotations

from typing import Annotated

import typer

from .._console import out


def recipes(
    name: Annotated[str, typer.Argument(metavar="NAME", help="One recipe, as its file.", show_default=False)] = "",
) -> None:
    """List the recipes that are shipped, algorithm and task; of one of them, its file, to be copied and changed."""
    from ...controllers.rl import recipe_text, shipped_recipes

    if name:
        out.print(recipe_text(name), end="", markup=False, soft_wrap=True)
        return
    for each in shipped_recipes():
        out.print(each)
