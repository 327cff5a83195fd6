"""Importing matplotlib, whatever the environment says about its backends."""

from __future__ import annotations

import os
import sys
from contextlib import suppress

__all__ = ["import_matplotlib"]


def import_matplotlib() -> None:
    """Import matplotlib before anything of it is used.

    Figures are made and written through its objects and need no backend; yet with one in MPLBACKEND that it
    does not know, ``import matplotlib`` fails. One that it knows is kept for whoever asks for windows.
    """
    if "matplotlib" in sys.modules:
        return
    wanted = os.environ.pop("MPLBACKEND", None)
    try:
        import matplotlib
    finally:
        if wanted is not None:
            os.environ["MPLBACKEND"] = wanted
    if wanted:
        with suppress(ValueError):
            matplotlib.rcParams["backend"] = wanted
