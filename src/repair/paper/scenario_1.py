"""Scenario 1, reconstructed from the paper's words and from facts about the official file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from repair.paper.roads import follow, lanelet_along, planning_problem, quarter_turn, scenario_of, turning

__all__ = ["scenario_1", "scenario_1_stops"]

# The ego starts at the origin, heading along +x. "Measured" means read off
# DEU_Flensburg-6_1_T-1 as this one number; "fitted" means chosen such that car 36, projected on the
# ego's path, occupies the same (s, t) region as there; "assumed" means that no source gives it.
_WIDTH = 3.5  # measured: width of every lane
_EGO_SPEED = 3.60  # measured
_NORTH = 12.85  # measured: x of the northbound lane's centre line, so distance to the corner
_SOUTH = _NORTH - _WIDTH  # measured 3.51 m beside it
# Curvature of the ego's left turn and its ramps. Measured 0.14 to 0.18 1/m, depending on how the
# lane's polyline is smoothed; with these ramps 0.165 fits the lane.
_EGO_TURN = (0.165, 6.0, 4.5)
_WEST_END, _EAST_END, _NORTH_END = 3.4, 19.35, 8.6  # where the junction ends: the turns just fit in
_APPROACH, _EXIT, _EAST = 40.0, 60.0, 130.0  # assumed: roads long enough for 10 s
_EAST_TURN = (0.16, 2.0, 5.0)  # assumed: lane from north to east, gentler at its end (as measured)
_KERB_TURN = 1.0 / 4.5  # assumed: right turns, which nobody drives here

# Car 36: all fitted; what was measured follows in brackets.
_CAR_START = 8.99  # y at the start (8.87) [m]
_CAR_END = 0.19  # y on the eastern lane at the end (0.1) [m]
_CAR_TURN = (0.2, 3.08, 11.99)  # a short begin and a long end of the turn (0.15 1/m in its middle)
# From standstill (2.1 m/s²), in the turn (1.0), out of it (2.1) and on (1.65), to 13.7 m/s (assumed)
_CAR_PROFILE = ((1.4, 1.94), (0.8, 0.67), (2.0, 2.28), (3.7, 1.6))
# The same beginning, then the car lets the ego pass: it brakes and stands before the ego's lane (ours).
_CAR_STOPS = ((1.4, 1.94), (0.7, -3.88))


def _junction() -> list[Any]:
    """Roads west (1xx0), north (1xx1), east (1xx2) and the six lanes that connect them."""
    half = np.pi / 2.0
    kerb = quarter_turn(-_KERB_TURN, 0.0, 0.0)
    w, e, n = _WEST_END, _EAST_END, _NORTH_END

    def straight(start: tuple[float, float], heading: float, length: float) -> Any:
        return start, heading, [(length, 0.0, 0.0)]

    def opposite(name: int) -> dict[str, Any]:
        return {"adjacent_left": name, "adjacent_left_same_direction": False}

    curves: dict[int, tuple[Any, dict[str, Any]]] = {
        101: (straight((-_APPROACH, 0.0), 0.0, w + _APPROACH), opposite(102) | {"successor": [111, 112]}),
        102: (straight((w, _WIDTH), np.pi, w + _APPROACH), opposite(101)),
        103: (straight((_NORTH, n), half, _EXIT), opposite(104)),
        104: (straight((_SOUTH, n + _EXIT), -half, _EXIT), opposite(103) | {"successor": [113, 114]}),
        105: (straight((e, 0.0), 0.0, _EAST - e), opposite(106)),
        106: (straight((_EAST, _WIDTH), np.pi, _EAST - e), opposite(105) | {"successor": [115, 116]}),
        111: (turning((w, 0.0), 0.0, _NORTH - w, n, quarter_turn(*_EGO_TURN)), {"successor": [103]}),
        112: (straight((w, 0.0), 0.0, e - w), opposite(115) | {"successor": [105]}),
        113: (turning((_SOUTH, n), -half, n, e - _SOUTH, quarter_turn(*_EAST_TURN)), {"successor": [105]}),
        114: (turning((_SOUTH, n), -half, n - _WIDTH, _SOUTH - w, kerb), {"successor": [102]}),
        115: (straight((e, _WIDTH), np.pi, e - w), opposite(112) | {"successor": [102]}),
        116: (turning((e, _WIDTH), np.pi, e - _NORTH, n - _WIDTH, kerb), {"successor": [103]}),
    }
    before: dict[int, list[int]] = {name: [] for name in curves}
    for name, (_, relations) in curves.items():
        for successor in relations.get("successor", ()):
            before[successor].append(name)
    return [
        lanelet_along(name, curve, _WIDTH, predecessor=before[name], **relations)
        for name, (curve, relations) in curves.items()
    ]


def scenario_1_stops() -> tuple[Any, Any]:
    """Scenario 1 in which car 36 begins as there, and then stops instead of crossing: a variation of ours.

    Who follows the plan of Scenario 1 touches nobody, and for who believes in constant speeds it looks
    for a while as if.

    Returns
    -------
    scenario, planning_problem_set
    """
    return _scenario("RepairTJunctionStops", _CAR_STOPS)


def scenario_1() -> tuple[Any, Any]:
    """The urban T-intersection (Sec. V-B): a reconstruction of the conflict in DEU_Flensburg-6_1_T-1.

    The ego turns left behind car 333, which stops 28 m up the road; car 36 comes the other way from
    standstill, turns left too and crosses the ego's lane between 1.4 and 3.6 s, 11 to 19 m ahead;
    bus 337 drives straight on and has cleared the mouth of the junction after 0.7 s.

    Reproduced: with obstacles as boxes in (s, l) inflated by 2.25 m and 2.0 m, and the ego a point
    at l = 0, TTC is 2.9 s if the ego slows down at 0.45 m/s² (or at 1 m/s² to 2.9 m/s, which it
    keeps). At constant speed it is 2.3 s here, on the original 2.3 or 2.4 s: there the point comes
    within centimetres of the box of car 36 at 2.3 s, and the path's smoothing decides. Inside the ego's lane
    car 36 is at most 0.15 m (s) and 0.25 m (l) off the original. Its numbers were fitted to that
    picture; among fits of like quality one was taken whose TTC agrees.

    Not reproduced: the other 21 road users, among them truck 30 that follows car 36 up to the stop
    line; the one-way main road (here every road has two lanes); the road beyond 60 m.

    Returns
    -------
    scenario, planning_problem_set
        CommonRoad objects; 10 s in steps of 0.1 s. The ego is on the exit lane at the end.
    """
    return _scenario("RepairTJunction", _CAR_PROFILE)


def _scenario(name: str, profile: Sequence[tuple[float, float]]) -> tuple[Any, Any]:
    """With one or the other motion of car 36."""
    half = np.pi / 2.0
    crossing = turning(
        (_SOUTH, _CAR_START), -half, _CAR_START - _CAR_END, _EAST - _SOUTH, quarter_turn(*_CAR_TURN)
    )
    # Car 333 [measured]: start, 11.7 m driven until it stands; profile of whole seconds fitted to the
    # distances (5.7, 9.0, 10.7, 11.4 m after 1 .. 4 s). Bus 337 [measured]: start; speed and
    # acceleration fitted to 6.6, 13.8, 21.8 m after 1 .. 3 s.
    leader = (_NORTH, 16.3), half, [(40.0, 0.0, 0.0)]
    bus = (13.98, 0.0), 0.0, [(_EAST - 13.98, 0.0, 0.0)]
    obstacles = [
        follow(36, "car", (4.75, 1.73), crossing, 0.0, profile),
        follow(333, "car", (4.70, 1.69), leader, 7.0,
                [(1.0, -2.65), (1.0, -2.0), (1.0, -1.35), (1.0, -0.6), (1.0, -0.4)]),
        follow(337, "bus", (12.14, 2.53), bus, 6.25, [(10.0, 0.7)]),
    ]  # fmt: skip
    scenario = scenario_of(name, "urban", _junction(), obstacles)
    return scenario, planning_problem(_EGO_SPEED, scenario.lanelet_network.find_lanelet_by_id(103))
