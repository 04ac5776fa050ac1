"""The named grounds by kind, as the figures show them: a panel for each kind."""

from __future__ import annotations

from typing import Final

from ...named import named, terrain_names

FIRM: Final = "firm ground"
#: In the order of the panels.
KINDS: Final = (FIRM, "sand", "loam", "clay", "snow", "other soil")


def ground_kind(name: str) -> str:
    """Return the kind of a named ground: of soil by the word in its name; clayey and sandy loams are loams."""
    if named(name).mode == "rigid":
        return FIRM
    return next((kind for kind in ("loam", "snow", "clay", "sand") if kind in name), "other soil")


def soil_names() -> tuple[str, ...]:
    """Names of the soils, sorted."""
    return tuple(name for name in terrain_names() if named(name).mode == "soil")
