"""Rows made by the workers of a Dask cluster that runs already (extra ``cluster``)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from repair.errors import RepairError, in_words
from repair.study.engine import Lane
from repair.study.plan import Task, package_version
from repair.study.worker import Answer, run_task, started

__all__ = ["ClusterLanes"]

_FOUND = 10.0  # how long to wait for the scheduler, and for a first worker [s]
_LOOKS = 1.0  # how often to ask who is there [s]


@dataclass
class _Remote:
    """A worker of the cluster; where it goes away, its task goes to another one."""

    name: str
    client: Any
    most: float = float("inf")  # whoever started it says what it may take

    def give(self, task: Task) -> Future[Answer]:
        executor = self.client.get_executor(pure=False, workers=[self.name], allow_other_workers=True)
        made: Future[Answer] = executor.submit(run_task, task)
        return made

    def ready(self) -> bool:
        return True

    def replace(self) -> bool:
        """Have the worker's nanny start it again; a worker without one is on its own."""
        with suppress(Exception):
            self.client.restart_workers([self.name], timeout=_FOUND, raise_for_error=False)
        return True


class ClusterLanes:
    """The workers of a Dask cluster, one task each, whatever its number of threads.

    Parameters
    ----------
    address : str
        Of the scheduler: ``tcp://127.0.0.1:8786``.

    Raises
    ------
    RepairError
        If Dask is not installed, nobody answers there, no worker is there, or one has another version of this
        package.
    """

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError as error:
            raise RepairError(
                f"a Dask cluster needs the package distributed: pip install distributed ({error})"
            ) from error
        try:
            connect: Any = distributed.Client
            self.client = connect(address, timeout=_FOUND, set_as_default=False)
            self.client.wait_for_workers(1, timeout=_FOUND)
            versions = self.client.run(started)
        except Exception as error:  # Dask's own errors are of many kinds
            with suppress(Exception):
                self.client.close()
            raise RepairError(f"no Dask cluster can be used at {address}: {in_words(error)}") from error
        self._looked, self._known = 0.0, dict[str, _Remote]()
        other = {name: v for name, v in versions.items() if v != package_version()}
        if other:
            self.close()
            name, theirs = next(iter(other.items()))
            raise RepairError(
                f"worker {name} has version {theirs} of commonroad-repair, and not {package_version()}"
            )

    def now(self) -> Sequence[Lane]:
        """The workers that are there; new ones join, and those that have gone are given nothing."""
        if time.monotonic() - self._looked > _LOOKS:
            self._looked = time.monotonic()
            with suppress(Exception):  # the scheduler is busy: as before
                there = self.client.scheduler_info(n_workers=-1)["workers"]
                self._known = {name: self._known.get(name) or _Remote(name, self.client) for name in there}
        return list(self._known.values())

    def close(self) -> None:
        """Take back what was asked for, and leave the cluster as it is."""
        with suppress(Exception):
            self.client.close()
