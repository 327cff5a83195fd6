"""Ends that leave room for a stop: what bounds them, and what casadi makes of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests import toy
from tests.roads import ROAD, driving, problem, scenario, state

import repair
from repair.backend.base import Capabilities, Closest, SolveResult, SolveStatus
from repair.backend.stopping import able_to_stop
from repair.check.verdict import Reason, Verdict, Violation
from repair.config import load_config
from repair.curves.base import SplicedCurve
from repair.preparation import prepare
from repair.reference.profile import SpeedProfile
from repair.search.probe import Budget, probe_one
from repair.solvers.casadi.backend import CasadiBackend
from repair.solvers.casadi.model import build_model
from repair.terminal.room import STOP_TIMES, RoomToStop, missed_by
from repair.terminal.verdict import Ending
from repair.world.boxes import Occupancy

BRAKING = 7.0
CAR = (-1.0, 1.0)  # on the path
T_END = 2.0


def leader(at: float, v: float, a: float, sideways=CAR, steps: int = 120) -> Occupancy:
    """A box that begins at ``at`` when the repair ends, and brakes with ``a`` until it stands."""
    t = toy.DT * np.arange(steps)
    moves = np.minimum(t, v / -a) if a < 0.0 else t
    rear = at + v * moves + 0.5 * a * moves**2
    lower = np.stack([rear, np.full(steps, sideways[0])], axis=1)[None]
    upper = np.stack([rear + 4.0, np.full(steps, sideways[1])], axis=1)[None]
    return Occupancy(t, np.array([7]), lower, upper, np.array([v == 0.0]))


def room(occupancy: Occupancy, wait: float = 0.0) -> RoomToStop:
    return RoomToStop(lambda: occupancy, BRAKING, BRAKING, wait)


def ends_at(s: float, v: float) -> SpeedProfile:
    """A motion that is at s, with v, when the repair ends."""
    return SpeedProfile.from_accelerations(s - v * T_END, v, [20.0], [0.0])


def strikes(occupancy: Occupancy, s: float, v: float, wait: float = 0.0) -> bool:
    """Whether full braking from (s, v) enters a box before it stands: by integration in small steps."""
    t = np.arange(0.0, v / BRAKING + wait + 1e-9, 1e-3)
    tau = np.minimum(t, v / BRAKING)
    place = s + v * tau - 0.5 * BRAKING * tau**2
    lower, upper = occupancy.at(t)
    return bool(((lower[..., 0] < place) & (place < upper[..., 0])).any())


AHEAD = st.tuples(st.floats(5.0, 60.0), st.floats(0.0, 20.0), st.sampled_from([0.0, -2.0, -8.0]))


@given(AHEAD, st.floats(0.5, 25.0), st.sampled_from([0.0, 1.0]))
def test_who_keeps_the_bounds_can_stop_and_who_stops_with_room_keeps_them(ahead, v, wait) -> None:
    traffic = leader(*ahead)
    within = room(traffic, wait).within(toy.problem([], t_end=T_END), ends_at(0.0, v))
    missed = missed_by(ends_at(0.0, v), T_END, within)
    if missed <= 0.0:
        assert not strikes(traffic, 0.0, v, wait)
    spare = 0.7 + v * toy.DT  # margin, what lies between two of the times, and a step
    if not strikes(leader(ahead[0] - spare, *ahead[1:]), 0.0, v, wait + toy.DT) and ahead[0] > spare:
        assert missed <= 0.0


@pytest.mark.parametrize(
    "traffic, asked",
    [
        (leader(30.0, 0.0, 0.0), True),
        (leader(-10.0, 15.0, 0.0), False),  # comes from behind
        (leader(30.0, 0.0, 0.0, sideways=(1.5, 3.5)), False),  # stands beside the path
        (leader(300.0, -15.0, 0.0), False),  # comes, but not before the vehicle stands
        (leader(60.0, -15.0, 0.0), True),
    ],
)
def test_ahead_is_what_is_met(traffic: Occupancy, asked: bool) -> None:
    within = room(traffic).within(toy.problem([], t_end=T_END), ends_at(0.0, 15.0))
    assert bool((within < 100.0).any()) is asked


def test_a_bend_leaves_less_to_brake_with() -> None:
    straight = toy.problem([], t_end=T_END)
    bend = replace(straight, curvature=np.full(2, 0.02))
    traffic = leader(30.0, 0.0, 0.0)
    here, there = (room(traffic).within(one, ends_at(0.0, 15.0)) for one in (straight, bend))
    assert (there[1:10] < here[1:10]).all()


# ------------------------------------------------------------------ the backend


def solved(traffic: Occupancy | None, **keys):
    """The same repair without and with what is about after its end."""
    plain = toy.problem([], t_end=T_END, lateral=False, **{"v0": 15.0, **keys})
    after = None if traffic is None else room(traffic)
    return CasadiBackend().solve(replace(plain, afterwards=after)), plain


@pytest.mark.parametrize("ahead", [(42.0, 0.0, 0.0), (36.0, 8.0, -8.0)])
def test_casadi_ends_slowly_enough(ahead) -> None:
    (before, plain), (after, _) = solved(None), solved(leader(*ahead))

    def end(result):
        state = result.curve.sample([T_END])
        return float(state.position[0, 0]), float(state.velocity[0, 0])

    assert strikes(leader(*ahead), *end(before))
    assert after.status is SolveStatus.SOLVED
    assert not strikes(leader(*ahead), *end(after))
    assert after.residuals["ending"] <= 1e-6
    assert after.closest is not None
    assert (after.closest.curve.points == before.curve.points).all()
    assert after.closest.miss == 0.0
    assert "ending" not in before.residuals
    assert plain.afterwards is None


def test_who_can_stop_anyway_is_not_asked_again() -> None:
    (before, _), (after, _) = solved(None), solved(leader(200.0, 0.0, 0.0))
    assert (after.curve.points == before.curve.points).all()
    assert after.closest is None


def test_where_no_end_is_slow_enough_there_is_what_was_found() -> None:
    late = {"t_rep": 1.0, "v0": 30.0}
    (before, _), (after, _) = solved(None, **late), solved(leader(70.0, 0.0, 0.0), **late)
    assert (after.curve.points == before.curve.points).all()
    assert "to be able to stop after it" in after.detail
    assert after.closest is None


def test_without_the_bounds_the_matrices_are_as_ever() -> None:
    backend, one = CasadiBackend(), toy.problem([], t_end=T_END)
    plain, bounded = (build_model(backend.structure(one, bounded=told)) for told in (False, True))
    assert plain.stopping is None
    kept, rows = bounded.stopping
    assert len(kept) == len(STOP_TIMES)
    others = np.delete(np.arange(bounded.linear_count), rows)
    assert (bounded.free[others] == plain.free).all()
    assert (bounded.given[others] == plain.given).all()


# ------------------------------------------------------------------ what the search judges


def test_the_closest_are_judged_one_after_the_other() -> None:
    one = toy.problem([], t_end=T_END, strict=True)
    curves = [ends_at(s, 15.0) for s in (30.0, 29.0, 28.0)]
    last = Closest(curves[2], 0.0, what="the last")
    result = SolveResult(SolveStatus.SOLVED, curves[0], closest=Closest(curves[1], 0.2, instead=last))

    class Backend:
        capabilities = Capabilities()

        def solve(self, problem, *, warm_start=None, time_limit=None):
            return result

    class Judge(toy.Judging):
        def check(self, problem, curve):
            asked.append(curve)
            bad = () if curve is wanted else (Violation(Reason.UNSAFE_END, 1.0),)
            return Verdict(bad)

    for wanted, strict, judged in (
        (curves[0], False, curves[:1]),
        (curves[1], False, curves[:2]),
        (curves[2], False, curves),
        (curves[2], True, [curves[0], curves[2]]),  # none of the margin may be given up
    ):
        asked: list = []
        probe = probe_one(
            0.0, replace(one, strict=strict), Backend(), Judge(), None, Budget(None, 0.0, lambda: 0.0)
        )
        assert probe.feasible
        assert probe.solve.curve is wanted
        assert asked == judged
    assert "the last passes every check" in probe.solve.detail


def test_a_closest_curve_that_ends_too_fast_is_asked_for_again() -> None:
    one = replace(toy.problem([], t_end=T_END), afterwards=room(leader(40.0, 0.0, 0.0)))
    fast, slow = Closest(ends_at(30.0, 15.0), 0.2), Closest(ends_at(25.0, 5.0), 0.3)
    asked: list = []

    def ask(within):
        asked.append(within)
        return SolveResult(SolveStatus.INFEASIBLE, closest=slow, residuals={"obstacles": 0.3})

    first = SolveResult(SolveStatus.INFEASIBLE, detail="no", closest=fast)
    found = able_to_stop(first, one, ask)
    assert len(asked) == 1
    assert found.curve is None
    assert found.closest.curve is slow.curve
    assert found.closest.instead is fast
    assert able_to_stop(first, replace(one, strict=True), ask) is first
    assert able_to_stop(first, replace(one, afterwards=None), ask) is first


@pytest.mark.parametrize("v", [0.0, 4.0])
def test_the_same_repair_with_a_safe_end(tmp_path: Path, v: float) -> None:
    """A car stands, or brakes hard, just beyond where the repair ends."""
    file = tmp_path / "ahead.xml"
    car = driving(41, 64.0 - 3.0 * v, 0.0, v, range(1, 91))
    file.write_text(
        scenario(road=ROAD, obstacles=car, problems=problem(100, state(20.0, 0.0, v=12.0))), encoding="utf-8"
    )
    ends = {}
    for asked in ("report", "require"):
        keys = [
            "reference.source=constant", "repair.lateral=none", "repair.after_conflict=0.1",
            f"checker.terminal={asked}",
        ]  # fmt: skip
        config = load_config(overrides=keys, backend="casadi")
        made = prepare(repair.load_scene(file, config), config)
        (one,) = made.source.at(1.2)
        curve = CasadiBackend(config.section("casadi")).solve(one).curve
        assert made.checker.check(one, curve).ok
        ends[asked] = made.ends(SplicedCurve(made.reference, curve, 1.2), made.t_end).ending
    assert ends["report"] is Ending.UNSAFE
    assert ends["require"] is not Ending.UNSAFE
