"""Whether results can be written somewhere: asked before the work, not after it."""

from __future__ import annotations

import os
from pathlib import Path

from repair.errors import OutputError

__all__ = ["require_folder"]


def require_folder(folder: Path) -> None:
    """Refuse an output folder that is a file, or can neither be made nor written to. Nothing is made yet.

    Raises
    ------
    OutputError
        With the reason.
    """
    try:
        nearest = next((path for path in (folder, *folder.parents) if path.exists()), Path())
        usable, writable = nearest.is_dir(), os.access(nearest, os.W_OK | os.X_OK)
    except (OSError, ValueError) as error:  # a name that is too long, or cannot be spelt
        why = error.strerror if isinstance(error, OSError) else error
        raise OutputError(f"the output folder {folder} cannot be made: {why}") from error
    if not usable:
        raise OutputError(f"the output folder {folder} cannot be made: {nearest} is a file")
    if not writable:
        raise OutputError(f"results cannot be written to {folder}: {nearest} is not writable")
