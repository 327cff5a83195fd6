"""The stops that are tried after a repair: braking along the path, then swerving to either side as well."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from repair.curves.base import FrenetTrajectory
from repair.scene.road.bounds import LateralBounds
from repair.terminal.stop import Settling, Stop, settling_from, stop_along
from repair.timegrid import intervals

if TYPE_CHECKING:
    from repair.problem.limits import Limits
    from repair.scene.frame import FrenetFrame

__all__ = ["Trial", "stops_from"]

_SHARES = (1.0, 0.7, 0.4)  # of full braking: who is struck from behind may brake less
_OFFSETS = (1.0, 2.0, 3.0, 4.0, 0.5, 1.5, 2.5, 3.5)  # of a swerve [m], as far as the evasive family goes
_LENGTHS = (0.9, 0.5)  # of a swerve, in shares of the way to standstill
_STRAIGHT = 1e-3  # slopes, and bends [1/m], below this are none
_STANDS = 1e-2  # who is slower than this stands [m/s]


class Trial(NamedTuple):
    """A stop, and what it is called: ``stand``, ``brake``, ``swerve_left`` or ``swerve_right``."""

    maneuver: str
    stop: Stop

    def waiting(self, duration: float, dt: float) -> Trial:
        """The same, and then standing for a duration [s]; ``dt`` is the scenario's time step [s]."""
        return self._replace(stop=replace(self.stop, t_end=self.stop.t_end + intervals(duration, dt) * dt))


def stops_from(
    state: FrenetTrajectory,
    frame: FrenetFrame,
    limits: Limits,
    bounds: LateralBounds,
    dt: float,
    *,
    lateral: bool,
) -> Iterator[Trial]:
    """What can be done from a state on to come to rest, full braking along the path first.

    Parameters
    ----------
    state : FrenetTrajectory
        Its first sample; on a scenario step.
    frame : FrenetFrame
    limits : Limits
    bounds : LateralBounds
        Where a swerve may end.
    dt : float
        Scenario time step [s].
    lateral : bool
        Whether swerving is allowed.
    """
    v = max(float(state.velocity[0, 0]), 0.0)
    name = "stand" if v < _STANDS else "brake"
    way = v * v / (-2.0 * limits.a_min) + 0.5 * v * dt
    ahead = _ahead(state, way)

    def made(path: Settling, share: float) -> Stop | None:
        return stop_along(state, path, frame, limits, dt, share)

    for share in _SHARES[: 1 if v < _STANDS else None]:
        for path in ahead:
            if (stop := made(path, share)) is not None:
                yield Trial(name, stop)
    if not lateral or v < 1.0:
        return
    s, l0 = (float(x) for x in state.position[0])
    right, left = (float(x) for x in bounds.at(s + 0.5 * way))
    for share in _SHARES:
        for length in _LENGTHS:
            for offset in _OFFSETS:
                for sign, side in ((1.0, "swerve_left"), (-1.0, "swerve_right")):
                    target = l0 + sign * offset
                    if right <= target <= left and (
                        stop := made(settling_from(state, target, length * way / share), share)
                    ):
                        yield Trial(side, stop)


def _ahead(state: FrenetTrajectory, way: float) -> list[Settling]:
    """Paths that go on as they are, straightened out over shorter or longer ways where they are not."""
    path = settling_from(state, None, max(way, 1.0))
    if np.abs(path.start[1:]).max() < _STRAIGHT:
        return [settling_from(state, float(state.position[0, 1]), max(way, 1.0))]
    return [path, *(settling_from(state, None, max(share * way, 1.0)) for share in (1.5, 0.6))]
