"""How do people run it? ``grouser VERB``, one small file a verb."""

from ._app import app, main

__all__ = ["app", "main"]
