"""Files that are there completely or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from repair.errors import OutputError

__all__ = ["write_files"]


def write_files(folder: Path, files: dict[str, bytes], stale: list[str] | None = None) -> list[Path]:
    """Write files into a folder (made if need be): all aside first, then renamed, so none is ever half there.

    Parameters
    ----------
    folder : Path
    files : dict
        Name to content.
    stale : list of str
        Names to remove: what an earlier run would have left under our own names.

    Raises
    ------
    OutputError
        With the operating system's reason.
    """
    made = _make_folder(folder)
    aside = {name: folder / f".{name}.{os.getpid()}.part" for name in files}
    try:
        for name, content in files.items():
            _write(aside[name], content)
        for name in stale or []:
            (folder / name).unlink(missing_ok=True)
        # The first file names the others: it comes last.
        for name in reversed(list(files)):
            os.replace(aside[name], folder / name)
    except OSError as error:
        raise OutputError(f"results cannot be written to {folder}: {error.strerror or error}") from error
    finally:
        for path in aside.values():
            _quietly(path.unlink)
        for path in made:
            _quietly(path.rmdir)  # only succeeds where nothing was written
    return [folder / name for name in files]


def _make_folder(folder: Path) -> list[Path]:
    """Make a folder and its parents; return those that were not there, innermost first."""
    missing = [p for p in (folder, *folder.parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        for path in missing:
            _quietly(path.rmdir)
        raise OutputError(f"the output folder {folder} cannot be made: {error.strerror or error}") from error
    return missing


def _write(path: Path, content: bytes) -> None:
    with open(path, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _quietly(action: Callable[[], None]) -> None:
    with suppress(OSError):
        action()
