"""Fixed evasive manoeuvres, their TTR, and the one repair at it."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from tests.toy import constant

from repair.api import find, repair, search
from repair.baselines.evasive.at_ttr import AtTtr
from repair.baselines.evasive.maneuvers import EvasiveManeuver, maneuvers_at
from repair.baselines.evasive.settings import EvasiveConfig
from repair.baselines.evasive.times import EvasiveStatus, brakes_free, evasive_ttr
from repair.config import load_config
from repair.curves.base import Curve, SplicedCurve
from repair.metrics.base import Asked
from repair.paper.scenario_1 import scenario_1
from repair.paper.scenario_2 import RoadDamage, scenario_2
from repair.preparation import prepare
from repair.scene.commonroad import scene_from_scenario
from repair.search.result import SearchStatus
from repair.search.settings import SearchConfig
from repair.solvers.registry import make_backend
from repair.vehicle.parameters import load_vehicle

VEHICLE = load_vehicle(1)
BRAKE, KICK, LEFT, RIGHT = EvasiveManeuver


def maneuvers(which, *, v0=10.0, t_start=1.0, t_end=5.0, **settings):
    return maneuvers_at(constant(v0), t_start, t_end, which, EvasiveConfig(**settings), VEHICLE)


def scene_of(generated):
    scenario, problems = generated
    return scene_from_scenario(scenario, next(iter(problems.planning_problem_dict.values())))


@pytest.fixture(scope="module")
def junction():
    return scene_of(scenario_1())


@pytest.fixture(scope="module")
def damage():
    return scene_of(scenario_2(RoadDamage(damage_width=2.0, damage_offset=0.0)))


def prepared(scene, number, *overrides, **keys):
    return prepare(scene, load_config(preset=f"scenario_{number}", overrides=overrides, **keys))


def times_of(ready):
    return evasive_ttr(ready, ready.config.evasive)


def at_ttr(ready, **keys):
    """The one repair at the TTR, by the drive that the configuration asks for."""
    assert ready.config.driver == "at_ttr"
    return search(ready, make_backend(ready.config.backend, ready.config), **keys)


# -- manoeuvres ------------------------------------------------------------------------------------


def test_braking_stops_and_stays():
    (curve,) = maneuvers(BRAKE, a_brake=8.0)
    assert isinstance(curve, Curve)
    samples = curve.sample(np.linspace(1.0, 5.0, 81))
    assert samples.velocity[:, 0].min() == pytest.approx(0.0, abs=1e-12)
    assert np.all(np.diff(samples.position[:, 0]) >= -1e-12)
    assert samples.position[-1, 0] == pytest.approx(10.0 + 10.0**2 / 16.0)
    assert not samples.position[:, 1].any()


def test_braking_from_rest_stays_put():
    (curve,) = maneuvers(BRAKE, v0=0.0)
    assert np.ptp(curve.sample(np.linspace(1.0, 5.0, 9)).position[:, 0]) == 0.0


def test_kick_down_respects_the_engine_and_the_top_speed():
    (curve,) = maneuvers(KICK, v0=VEHICLE.v_max - 0.5, t_end=9.0, a_kick=8.0)
    speed = curve.sample(np.linspace(1.0, 9.0, 200)).velocity[:, 0]
    assert speed.max() <= VEHICLE.v_max + 1e-9
    (slow,) = maneuvers(KICK, v0=20.0, a_kick=8.0)
    first = slow.sample([1.01]).acceleration[0, 0]
    assert first == pytest.approx(VEHICLE.a_max * VEHICLE.v_switch / 20.0)


@pytest.mark.parametrize("model", ["point_mass", "kinematic"])
@pytest.mark.parametrize("which", [LEFT, RIGHT])
def test_steering_reaches_every_offset_and_goes_straight(model, which):
    curves = maneuvers(which, v0=12.0, t_end=9.0, model=model, a_steer=6.0, offset_max=4.0, offset_step=0.5)
    sign = 1.0 if which is LEFT else -1.0
    for k, curve in enumerate(curves, start=1):
        end = curve.sample([9.0])
        np.testing.assert_allclose(end.position[0, 1], sign * 0.5 * k, atol=1e-9)
        np.testing.assert_allclose([end.velocity[0, 1], end.acceleration[0, 1]], 0.0, atol=1e-9)
        fine = curve.sample(np.linspace(1.0, 9.0, 2000))
        assert np.abs(fine.acceleration[:, 1]).max() <= 6.0 + 1e-9
        assert np.abs(np.diff(fine.position[:, 1])).max() < 0.05
    assert len(curves) == 8


def test_kinematic_steering_is_limited_by_rate_and_angle():
    v = 12.0
    (curve, *_) = maneuvers(
        LEFT, v0=v, t_end=9.0, model="kinematic", a_steer=6.0, offset_max=3.0, offset_step=3.0
    )
    fine = curve.sample(np.linspace(1.0, 9.0, 4000))
    jerk = v**2 * VEHICLE.steering_rate_max / VEHICLE.wheelbase
    assert np.abs(fine.jerk[:, 1]).max() == pytest.approx(jerk)
    assert np.abs(np.diff(fine.acceleration[:, 1])).max() <= 1.01 * jerk * 8.0 / 3999
    (creep, *_) = maneuvers(LEFT, v0=1.0, t_end=60.0, model="kinematic", a_steer=6.0)
    strongest = np.tan(VEHICLE.steering_max) / VEHICLE.wheelbase
    assert np.abs(creep.sample(np.linspace(1, 60, 2000)).acceleration[:, 1]).max() <= strongest + 1e-9


def test_kinematic_steering_from_rest_does_not_exist():
    assert len(maneuvers(LEFT, v0=0.0, model="kinematic")) == 0


# -- TTR -------------------------------------------------------------------------------------------


def test_braking_gives_the_ttr_of_scenario_1(junction):
    result = times_of(prepared(junction, 1))
    assert result.ttr == result.ttb == pytest.approx(2.6, abs=0.11)
    assert result.ttk == -np.inf
    assert result.maneuver is BRAKE
    assert result.status[KICK] is EvasiveStatus.NEVER
    assert result.curve.t_start == result.ttr


def test_steering_gives_the_ttr_of_the_road_damage(damage):
    result = times_of(prepared(damage, 2))
    assert result.maneuver is LEFT
    assert result.tts == result.tts_left == result.ttr > result.ttb
    assert result.tts_right == -np.inf


def test_later_starts_fail_and_the_ttr_does_not(junction):
    ready = prepared(junction, 1)
    result = times_of(ready)
    for step, hits in ((0, False), (1, True)):
        t = result.ttb + step * ready.scene.dt
        (curve,) = maneuvers_at(
            ready.reference, t, ready.t_end, BRAKE, ready.config.evasive, ready.scene.vehicle
        )
        contact = ready.checker.contact(SplicedCurve(ready.reference, curve, t), ready.t_end)
        assert (contact is not None) == hits


@pytest.mark.parametrize("which", EvasiveManeuver)
def test_a_manoeuvre_is_judged_from_where_it_begins_as_the_whole_drive_is(junction, damage, which):
    judged = set()
    for ready in (prepared(junction, 1), prepared(damage, 2)):
        latest = round(ready.conflict.time / ready.scene.dt) - 1
        for t in ready.scene.dt * np.arange(0, latest + 1, 3):
            curves = maneuvers_at(
                ready.reference, t, ready.t_end, which, ready.config.evasive, ready.scene.vehicle
            )
            for curve in curves[::3]:
                driven = SplicedCurve(ready.reference, curve, t)
                states = ready.checker.drive(driven, ready.t_end)
                late = states.t >= t - 1e-9
                clear = ready.checker.contact(driven, ready.t_end) is None
                on_road = (
                    ready.checker.road.first_off_road(
                        states.x[late], states.y[late], states.orientation[late]
                    )
                    is None
                )
                for road, kept in ((False, clear), (True, clear and on_road)):
                    assert ready.checker.is_free(ready.reference, curve, ready.t_end, road=road) == kept
                    judged.add(kept)
    assert judged == {True, False} or which is KICK


def test_braking_after_the_contact_avoids_nothing(junction):
    ready = prepared(junction, 1)
    met, end = ready.conflict.contact_time, ready.t_end
    late = [float(t) for t in ready.scene.dt * np.arange(1, 40) if met < t < end]
    assert not any(brakes_free(ready, ready.config.evasive, t) for t in late)
    curves = [maneuvers_at(ready.reference, t, end, BRAKE, ready.config.evasive, VEHICLE)[0] for t in late]
    assert any(ready.checker.is_free(ready.reference, c, end, road=False) for c in curves)  # and it is past


def test_boxes_are_never_later_than_rectangles_plus_a_step(junction):
    boxes = times_of(prepared(junction, 1, "evasive.collision=boxes"))
    assert boxes.ttb <= times_of(prepared(junction, 1)).ttb + 0.1 + 1e-9


def test_weaker_braking_has_to_begin_earlier(junction):
    times = [times_of(prepared(junction, 1, f"evasive.a_brake={a}")).ttb for a in (2.0, 4.0, 8.0)]
    assert times == sorted(times)
    assert times[0] < times[-1]


def test_without_a_conflict_everything_is_infinite():
    free = scene_of(scenario_2(RoadDamage(damage_gap=400.0)))
    result = times_of(prepared(free, 2, "repair.horizon=3"))
    assert result.ttb == result.ttk == result.tts == result.ttr == np.inf
    assert result.maneuver is None
    assert set(result.status.values()) == {EvasiveStatus.NO_CONFLICT}
    answer = at_ttr(prepared(free, 2, backend="qptr", driver="at_ttr"))
    assert answer.status is SearchStatus.NO_CONFLICT
    assert answer.search.probes == ()
    assert answer.ttr == np.inf
    assert answer.to_dict()["metrics"] == {"ttr": {"value_s": None, "status": "no_conflict"}}


# -- one repair at TTR -----------------------------------------------------------------------------


def test_qptr_has_no_answer_at_the_ttr_of_either_scenario(junction, damage):
    for number, scene in ((1, junction), (2, damage)):
        answer = at_ttr(prepared(scene, number, backend="qptr", driver="at_ttr"))
        assert answer.status is SearchStatus.NONE_FEASIBLE
        assert answer.search.complete
        (probe,) = answer.search.probes
        assert probe.t_rep == pytest.approx(answer.ttr)
        assert probe.solve.curve is None


def test_problem_is_built_around_the_maneuver(junction):
    ready = prepared(junction, 1)
    evasive = times_of(ready)
    source = AtTtr(ready.source, evasive)
    assert source.visits == (evasive.ttr,)
    first, *others = source.at(evasive.ttr)
    assert first.t_rep == pytest.approx(evasive.ttr)
    guide = first.passing.guide
    np.testing.assert_allclose(guide.position, evasive.curve.sample(guide.t).position)
    # The other open sides, that of the manoeuvre left out, are those of any search.
    usual = [p.passing.maneuver for p in ready.source.at(evasive.ttr)]
    assert [p.passing.maneuver for p in others] == [m for m in usual if m is not first.passing.maneuver]
    margins = [problems[0].margin for problems in source.relaxed(0.4)]
    assert margins == [problems[0].margin for problems in ready.source.relaxed(0.4)]


def test_without_a_maneuver_nothing_is_visited(junction):
    ready = prepared(
        junction, 1, "evasive.a_brake=0.1", "evasive.a_steer=0.1", driver="at_ttr", backend="qptr"
    )
    evasive = times_of(ready)
    assert evasive.ttr == -np.inf
    source = AtTtr(ready.source, evasive)
    assert (source.visits, source.at(1.0)) == ((), ())
    answer = at_ttr(ready)
    assert (answer.status, answer.search.probes) == (SearchStatus.NONE_FEASIBLE, ())
    assert answer.ttr == -np.inf
    assert answer.to_dict()["metrics"] == {"ttr": {"value_s": None, "status": "never"}}


def test_repair_at_an_early_ttr_is_found(junction):
    overrides = ["evasive.a_brake=1.5", "qptr.solver=daqp"]
    ready = prepared(junction, 1, *overrides, backend="qptr", driver="at_ttr")
    answer = at_ttr(ready)
    assert answer.status is SearchStatus.FOUND
    assert answer.f_ttr == pytest.approx(answer.ttr)
    assert answer.search.curve is not None
    # Whichever way it is asked for.
    found = find(ready, make_backend("qptr", ready.config))
    again = repair(junction, preset="scenario_1", backend="qptr", overrides=[*overrides, "driver=at_ttr"])
    for other in (found, again.search):
        assert (other.status, other.f_ttr) == (answer.status, answer.f_ttr)
        times = np.linspace(answer.f_ttr, ready.t_end, 20)
        np.testing.assert_array_equal(
            other.curve.sample(times).position, answer.search.curve.sample(times).position
        )
    assert again.ttr == answer.ttr


EARLY = ("evasive.a_brake=1.5",)


def test_the_ttr_is_kept_and_shown(junction, capsys, tmp_path):
    from repair.cli.command import main

    answer = at_ttr(prepared(junction, 1, *EARLY, backend="qptr", driver="at_ttr"))
    assert answer.metrics["ttr"].value == answer.ttr == times_of(answer.prepared).ttr
    kept = answer.to_dict()["metrics"]
    assert kept == {"ttr": {"value_s": pytest.approx(answer.ttr), "status": "found"}}
    assert answer.outcome.metrics == {"ttr": pytest.approx(answer.ttr)}
    argv = ["run", "scenario_1", "--backend", "qptr", "--set", "driver=at_ttr", *EARLY]
    assert main(argv) == 0
    assert f"Metrics   TTR {answer.ttr:.2f} s\n" in capsys.readouterr().out
    assert main(["run", "scenario_1"]) == 0
    assert "Metrics" not in capsys.readouterr().out


def test_the_search_without_metrics_has_no_ttr(junction):
    answer = repair(junction, preset="scenario_1", backend="qptr")
    assert answer.ttr is None
    assert answer.metrics == answer.to_dict()["metrics"] == {}


def test_at_ttr_keeps_the_time_limit(junction):
    answer = at_ttr(prepared(junction, 1, "search.time_limit=0", *EARLY, backend="qptr", driver="at_ttr"))
    assert (answer.status, answer.search.complete) == (SearchStatus.BUDGET_EXHAUSTED, False)
    assert answer.search.probes == ()
    assert answer.f_ttr is None
    assert answer.ttr is None  # there was no time for it either
    content = answer.to_dict()
    assert (content["status"], content["complete"]) == ("budget_exhausted", False)
    assert content["metrics"] == {}


def test_finding_the_ttr_is_part_of_the_time(junction):
    """What the backend is told is left is less than the limit by the time of the manoeuvres."""
    ready = prepared(junction, 1, "search.time_limit=100", *EARLY, backend="qptr", driver="at_ttr")
    inner, limits = make_backend("qptr", ready.config), []

    class Listening:
        name, capabilities = inner.name, inner.capabilities

        def solve(self, problem, *, warm_start=None, time_limit=None):
            limits.append(time_limit)
            return inner.solve(problem, warm_start=warm_start, time_limit=time_limit)

    class Slow(Asked):
        @property
        def evasive(self):
            time.sleep(0.2)
            return times_of(ready)

    find(ready, Listening(), asked=Slow(ready, ready.config.evasive))
    assert 0.0 < limits[0] <= 99.8
    # The manoeuvres alone may take it all; then no problem is made.
    ready = replace(ready, config=replace(ready.config, search=SearchConfig(time_limit=0.1)))
    found = find(ready, Listening(), asked=Slow(ready, ready.config.evasive))
    assert (found.status, found.probes, found.complete) == (SearchStatus.BUDGET_EXHAUSTED, (), False)


def test_an_interrupt_at_the_ttr_keeps_what_was_found(junction):
    def pressed(*_, **__):
        raise KeyboardInterrupt

    ready = prepared(junction, 1, *EARLY, backend="qptr", driver="at_ttr")
    answer = at_ttr(ready, on_probe=pressed)
    assert (answer.status, answer.search.complete) == (SearchStatus.FOUND, False)
    assert answer.f_ttr == pytest.approx(answer.ttr)
    assert answer.to_dict()["complete"] is False

    class Interrupted:
        name, capabilities = "interrupted", make_backend("qptr", ready.config).capabilities
        solve = pressed

    answer = search(ready, Interrupted())
    assert (answer.status, answer.search.complete) == (SearchStatus.BUDGET_EXHAUSTED, False)
    assert (answer.f_ttr, answer.search.probes) == (None, ())
    assert answer.ttr == times_of(ready).ttr


def test_keys_of_the_search_become_notes_at_the_ttr(junction):
    overrides = ["search.rule=scan", "search.upper=0.4", *EARLY]
    answer = at_ttr(prepared(junction, 1, *overrides, backend="qptr", driver="at_ttr"))
    assert answer.f_ttr == pytest.approx(answer.ttr)
    assert answer.ttr > 0.4
    notes = [note for note in answer.to_dict()["notes"] if "no effect" in note]
    assert notes == [
        "search.rule has no effect with driver=at_ttr", "search.upper has no effect with driver=at_ttr",
    ]  # fmt: skip


# -- metrics ---------------------------------------------------------------------------------------

NAMES = ("ttb", "ttk", "tts", "ttr")


@pytest.mark.thinned(2)
@pytest.mark.parametrize("driver", ["f_ttr", "at_ttr"])
def test_metrics_are_those_of_the_maneuvers(junction, damage, driver):
    for number, scene in ((1, junction), (2, damage)):
        ready = prepared(scene, number, f"metrics=[{', '.join(NAMES)}]", driver=driver)
        expected = times_of(ready)
        answer = search(ready, make_backend("ego", ready.config))
        assert tuple(answer.metrics) == NAMES
        for name in NAMES:
            value, status = answer.metrics[name].value, answer.metrics[name].status
            assert value == getattr(expected, name)
            assert status == ("never" if value == -np.inf else "found")
            kept = answer.to_dict()["metrics"][name]
            assert kept["status"] == status
            assert kept["value_s"] == (None if value == -np.inf else pytest.approx(value))
        assert answer.ttr == expected.ttr == max(answer.metrics[name].value for name in NAMES[:3])


def test_metrics_are_shown_in_their_order(junction, capsys):
    from repair.cli.command import main

    expected = times_of(prepared(junction, 1))
    assert main(["run", "scenario_1", "--set", "metrics=[ttr, ttk, ttb]"]) == 0
    assert f"Metrics   TTR {expected.ttr:.2f} s, TTK never, TTB {expected.ttb:.2f} s\n" in (
        capsys.readouterr().out
    )


@pytest.mark.parametrize("name", ["DEU_Flensburg-6_1_T-1"])
def test_official_scenario_1(scenarios, name):
    from repair.scene.commonroad import load_scene

    ready = prepared(load_scene(scenarios / f"{name}.xml"), 1)
    assert ready.conflict.time == pytest.approx(2.9)
    # 2.5 or 2.6 s: it hangs on centimetres, so on the speed that the reference has in the turn.
    assert times_of(ready).ttr == pytest.approx(2.6, abs=0.11)
