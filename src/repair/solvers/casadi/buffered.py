"""CasADi functions on NumPy arrays, how many are kept, a watch that stops a solver in time, and errors."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from repair.arrays import Array
from repair.errors import BackendError

__all__ = [
    "Buffered",
    "Deadline",
    "KeptBySize",
    "deadline_callback",
    "last_line",
    "quadratic_program",
    "sparse",
    "unavailable",
]


Key = TypeVar("Key", bound=Hashable)
Made = TypeVar("Made")


class _Info(NamedTuple):
    hits: int
    misses: int
    maxsize: float
    currsize: int


class KeptBySize(Generic[Key, Made]):
    """Makes a thing for a key and keeps it; the ones not used for longest go when all take too much memory.

    A search over a long time needs many things, and the next one of the same situation needs them again; a
    process that goes from one situation to the next does not. So what was asked for lately may take more.

    Parameters
    ----------
    make : callable
    size : callable
        About how much memory a key's thing takes [MB].
    most : float
        How much all of them may take [MB]; the last one is kept however large it is.
    idle : float, optional
        How much they may take [MB] as long as one of them was not asked for lately; the same by default.
    lately : int
        So many askings ago and less is lately.
    """

    def __init__(
        self,
        make: Callable[[Key], Made],
        size: Callable[[Key], float],
        most: float,
        idle: float | None = None,
        lately: int = 32,
    ) -> None:
        self._make, self._size, self._most = make, size, most
        self._idle, self._lately = most if idle is None else idle, lately
        self._kept: OrderedDict[Key, Made] = OrderedDict()
        self._asked: dict[Key, int] = {}  # the number of the last asking, of those that are kept
        self._lock = threading.Lock()
        self._hits = self._misses = 0

    def __call__(self, key: Key) -> Made:
        """What was made for a key, made now if it is not there."""
        with self._lock:
            asked = self._hits + self._misses
            if key in self._kept:
                self._asked[key] = asked
                self._hits += 1
                self._kept.move_to_end(key)
                return self._kept[key]
            self._misses += 1
        made = self._make(key)  # two threads may make the same thing; the first one is kept
        with self._lock:
            made = self._kept.setdefault(key, made)
            self._asked.setdefault(key, asked)
            while len(self._kept) > 1 and self.megabytes > self._allowed():
                gone, _ = self._kept.popitem(last=False)
                del self._asked[gone]
        return made

    def _allowed(self) -> float:
        """How much they may take now [MB]."""
        first = self._hits + self._misses - self._asked[next(iter(self._kept))]
        return self._most if first <= self._lately else self._idle

    @property
    def megabytes(self) -> float:
        """About how much memory is in use [MB]."""
        return sum(self._size(key) for key in self._kept)

    def cache_info(self) -> _Info:
        """As that of :func:`functools.lru_cache`; the largest size in MB, the current one in things."""
        return _Info(self._hits, self._misses, self._most, len(self._kept))

    def cache_clear(self) -> None:
        """Forget all of them."""
        with self._lock:
            self._kept.clear()
            self._asked.clear()
            self._hits = self._misses = 0


class Buffered:
    """A CasADi function that reads and writes NumPy arrays of its own.

    Called with DM it spends several times what a small QP takes on converting them.

    Parameters
    ----------
    function : casadi.Function
        All its inputs dense, or given in ``fixed``.
    fixed : casadi.DM
        Inputs that never change, by name.
    """

    def __init__(self, function: Any, **fixed: Any) -> None:
        self._buffer, self._evaluate = function.buffer()
        self._inputs: dict[str, Array] = {}
        # An input that is left out would be read as zeros, or crash the plugin: all are set.
        for k, name in enumerate(function.name_in()):
            value = np.full(function.nnz_in(k), function.default_in(k))
            if name in fixed:
                value[:] = fixed[name].nonzeros()
            self._inputs[name] = value
            self._buffer.set_arg(k, value.data)
        self._outputs: dict[str, Array] = {}
        for k, name in enumerate(function.name_out()):
            self._outputs[name] = np.zeros(function.nnz_out(k))
            self._buffer.set_res(k, self._outputs[name].data)

    def __call__(self, **values: Array) -> dict[str, Array]:
        """Evaluate; the outputs by name are overwritten by the next call."""
        for name, value in values.items():
            self._inputs[name][:] = value
        try:
            self._evaluate()
        except SystemError as error:  # what an interrupt becomes on its way through CasADi's buffers
            if isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
                raise KeyboardInterrupt from None
            raise
        return self._outputs

    def stats(self) -> dict[str, Any]:
        """The solver's statistics of the last call."""
        return dict(self._buffer.stats())


class Deadline:
    """Holds CasADi's callback and the time at which it stops the solver.

    Attributes
    ----------
    at : float
        Of :func:`time.perf_counter` [s]; infinite to begin with.
    callback : casadi.Callback
        CasADi does not keep it alive.
    """

    def __init__(self) -> None:
        self.at = float("inf")
        self.callback: Any = None


def deadline_callback(nlp: dict[str, Any]) -> Deadline:
    """A watch over the solver of an NLP, to be given to it as ``iteration_callback``.

    Parameters
    ----------
    nlp : dict
        What CasADi's ``nlpsol`` takes.
    """
    import casadi as ca

    holder = Deadline()
    sizes = {"x": nlp["x"].numel(), "f": 1, "g": nlp["g"].numel(), "lam_x": nlp["x"].numel(),
             "lam_g": nlp["g"].numel(), "lam_p": nlp["p"].numel()}  # fmt: skip

    class Watch(ca.Callback):
        def __init__(self) -> None:
            ca.Callback.__init__(self)
            self.construct("watch", {})

        def get_n_in(self) -> int:
            return int(ca.nlpsol_n_out())

        def get_n_out(self) -> int:
            return 1

        def get_name_in(self, i: int) -> str:
            return str(ca.nlpsol_out(i))

        def get_name_out(self, i: int) -> str:
            return "ret"

        def get_sparsity_in(self, i: int) -> Any:
            return ca.Sparsity.dense(sizes[ca.nlpsol_out(i)], 1)

        def eval(self, arg: Any) -> list[int]:
            return [1 if time.perf_counter() > holder.at else 0]

    holder.callback = Watch()
    return holder


def quadratic_program(name: str, hessian: Any, matrix: Any) -> Buffered:
    """A QP that daqp solves, of constant Hessian and rows (``casadi.DM``).

    Raises
    ------
    RuntimeError
        Of CasADi, where it cannot make the solver.
    """
    import casadi as ca

    shapes = {"h": hessian.sparsity(), "a": matrix.sparsity()}
    function = ca.conic(name, "daqp", shapes, {"error_on_fail": False})
    return Buffered(function, h=hessian, a=matrix)


def sparse(matrix: Array) -> Any:
    """A matrix as ``casadi.DM``, without the entries that are zero but for rounding."""
    import casadi as ca

    return ca.sparsify(ca.DM(np.where(np.abs(matrix) < 1e-14, 0.0, matrix)))


def unavailable(error: Exception) -> BackendError:
    """What to raise where CasADi cannot make a solver."""
    return BackendError(f"CasADi cannot make the solver: {last_line(error)}")


def last_line(error: Exception) -> str:
    """The last line of what CasADi throws: its reason; the lines before say where in its source."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else type(error).__name__
