"""Files that are there completely or not at all, and sets of files that are replaced as one.

Several threads and processes may write into one folder. Each writes its files aside, under names that
nobody else has; then, one at a time, they put them in place. Where a set has several files the first
one names the others: it is taken away before they are replaced and comes back last, so that it never
stands beside files of another set.
"""

from __future__ import annotations

import errno
import os
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from repair.errors import OutputError

fcntl: Any = None
with suppress(ImportError):  # elsewhere than on POSIX
    import fcntl

__all__ = ["write_files"]

#: How long to wait for others that are putting files in place [s]; it takes them milliseconds.
_PATIENCE = 10.0
_PAUSE = 0.002


def write_files(folder: Path, files: dict[str, bytes], stale: list[str] | None = None) -> list[Path]:
    """Write files into a folder (made if need be): all aside first, then renamed, so none is ever half there.

    Parameters
    ----------
    folder : Path
    files : dict
        Name to content; the first one names the others.
    stale : list of str
        Names to remove: what an earlier run would have left under our own names.

    Raises
    ------
    OutputError
        With the operating system's reason, or where another process keeps the folder to itself.
    """
    made = _make_folder(folder)
    mark = uuid.uuid4().hex[:16]
    aside = {name: folder / f".{name}.{mark}.part" for name in files}
    done = False
    try:
        for name, content in files.items():
            _write(aside[name], content)
        with _alone(folder):
            _put(folder, aside, stale or [], folder / f".before.{mark}.part")
        done = True
    except OSError as error:
        raise OutputError(f"results cannot be written to {folder}: {error.strerror or error}") from error
    finally:
        if not done:
            for path in aside.values():
                _quietly(path.unlink)
            for path in made:
                _quietly(path.rmdir)  # only succeeds where nothing was written
    return [folder / name for name in files]


def _put(folder: Path, aside: dict[str, Path], stale: list[str], before: Path) -> None:
    """Rename the files into place, the first one last; where nothing is changed yet all stays as it was."""
    first, *others = aside or [""]
    for name in (*aside, *stale):
        if (folder / name).is_dir():
            raise IsADirectoryError(errno.EISDIR, f"{name} is a folder there")
    parked = False
    if aside and (others or stale):
        with suppress(FileNotFoundError):
            os.replace(folder / first, before)
            parked = True
    touched = False
    try:
        for name in stale:
            with suppress(FileNotFoundError):
                (folder / name).unlink()
                touched = True
        for name in others:
            os.replace(aside[name], folder / name)
            touched = True
        if aside:
            os.replace(aside[first], folder / first)
    except BaseException:
        if parked and not touched:
            _quietly(lambda: os.replace(before, folder / first))
        raise
    finally:
        if parked:
            _quietly(before.unlink)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keep other threads and processes from putting files in place.

    The lock is the kernel's, on the folder itself: nothing is left behind, and it ends with its process.
    Where the file system has no locks there is none.
    """
    if fcntl is None:
        yield
        return
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        deadline = time.monotonic() + _PATIENCE
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise OutputError(
                        f"results cannot be written to {folder}: another process has been writing there for "
                        f"{_PATIENCE:g} s"
                    ) from None
                time.sleep(_PAUSE)
            except OSError:
                break
        yield
    finally:
        os.close(handle)


def _make_folder(folder: Path) -> list[Path]:
    """Make a folder and its parents; return those that were not there, innermost first."""
    missing: list[Path] = []
    try:
        missing = [p for p in (folder, *folder.parents) if not p.exists()]
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


def _quietly(action: Callable[[], object]) -> None:
    with suppress(OSError):
        action()
