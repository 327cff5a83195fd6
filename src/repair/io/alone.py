"""A folder that one process at a time works in."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from pathlib import Path
from typing import Any

from repair.errors import OutputError

fcntl: Any = None
with suppress(ImportError):  # elsewhere than on POSIX
    import fcntl

__all__ = ["Alone"]


class Alone:
    """Keep other processes out of a folder until this is closed.

    The lock is the kernel's, on a hidden file that stays and says who had it last: it ends with its process,
    however that ends. Where the file system has no locks there is none.

    Parameters
    ----------
    folder : Path
        It has to be there.
    what : str
        What another one does there, in words.

    Raises
    ------
    OutputError
        If another process, or another one in this process, has it; or the file cannot be made.
    """

    def __init__(self, folder: Path, what: str) -> None:
        self.handle: int | None = None
        if fcntl is None:
            return
        path = folder / ".lock"
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise OutputError(f"{path} cannot be made: {error.strerror or error}") from error
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(handle, 200).decode("utf-8", "replace").strip()
            os.close(handle)
            raise OutputError(
                f"{what} in {folder} is running already{f' ({holder})' if holder else ''}; "
                "wait for it to end, or take another folder"
            ) from None
        except OSError:  # no locks here
            os.close(handle)
            return
        self.handle = handle
        with suppress(OSError):  # for people only
            os.ftruncate(handle, 0)
            os.write(handle, f"process {os.getpid()} on {socket.gethostname()}".encode())

    def close(self) -> None:
        """Let others in."""
        if self.handle is not None:
            os.close(self.handle)
            self.handle = None
