"""Several predictions of one obstacle: what each of them alone would allow."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from repair.scene.traffic.obstacle import Obstacle
from repair.scene.traffic.prediction import Mode
from repair.search.result import SearchResult

__all__ = ["ModeResult", "each_mode"]


@dataclass(frozen=True)
class ModeResult:
    """The answer if one mode were certain, all other obstacles being as they are.

    Attributes
    ----------
    obstacle_id : int
    name : str
        Of the mode.
    probability : float
        A number from 0 to 1.
    stands_as : int
        The id under which it is among the traffic.
    status : str
        How its search ended.
    ttc : float
        [s]; inf without a conflict.
    f_ttr : float or None
        [s]; inf without a conflict, None where nothing was verified.
    """

    obstacle_id: int
    name: str
    probability: float
    stands_as: int
    status: str
    ttc: float
    f_ttr: float | None


def each_mode(
    modes: Sequence[Mode],
    obstacles: Sequence[Obstacle],
    found: SearchResult,
    search: Callable[[tuple[Obstacle, ...]], SearchResult],
) -> tuple[ModeResult, ...]:
    """Search again for each mode of each obstacle that has several.

    The repair that is clear of all modes is clear of each: no F-TTR of a mode is below the one of all.

    Parameters
    ----------
    modes : sequence of Mode
    obstacles : sequence of Obstacle
        The traffic, all modes among it.
    found : SearchResult
        The answer for all modes together.
    search : callable
        The same search among other traffic.
    """
    results = []
    for mode in modes:
        others = {m.stands_as for m in modes if m.obstacle_id == mode.obstacle_id and m is not mode}
        single = search(tuple(o for o in obstacles if o.id not in others))
        status, f_ttr = single.status.value, single.f_ttr
        if found.f_ttr is not None and (f_ttr is None or f_ttr < found.f_ttr):
            status, f_ttr = found.status.value, found.f_ttr
        results.append(
            ModeResult(
                mode.obstacle_id, mode.name, mode.probability, mode.stands_as, status,
                single.conflict.time, f_ttr,
            )
        )  # fmt: skip
    return tuple(results)
