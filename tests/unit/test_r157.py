"""UN R157: the driver models, in both readings, and what they come to."""

from __future__ import annotations

import math

import numpy as np
import pytest

from repair.cli.command import main
from repair.errors import ConfigError, ScenarioError
from repair.r157.cases import CASES, GRAVITY, KMH, LENGTH, WIDTH, Points, grid
from repair.r157.compare import compare
from repair.r157.drive import drive, keep
from repair.r157.models import MODELS
from repair.r157.motion import stated
from repair.r157.one import drive_one
from repair.r157.picture import picture
from repair.r157.results import by_models, rows_of, table_of

PAIRS = [(case, name) for case in CASES for name, model in MODELS.items() if case.startswith(model.cases)]

# Published outcomes of single points: case, ego, other [km/h], distance [m], lateral [m/s], deceleration [g],
# model, own speed at impact [m/s] (None: no collision), and when [s].
PUBLISHED = [
    ("cut_in_low", 60, 20, 19, 1.7, 0.0, "CC", 16.3467, 3.0),
    ("cut_in_low", 60, 20, 19, 1.7, 0.0, "Reg157", 11.2667, 3.2),
    ("cut_in_low", 60, 20, 19, 1.7, 0.0, "RSS", None, None),
    ("cut_in_low", 60, 40, 4, 1.3, 0.0, "FSM", 12.4017, 2.2),
    ("cut_in_low", 50, 10, 15, 1.4, 0.0, "FSM", 6.6239, 2.8),
    ("cut_in_low", 60, 20, 2, 0.4, 0.0, "CC", None, None),
    ("cut_out", 130, 130, 67, 0.7, 0.0, "RSS", 9.1572, 5.1),
    ("cut_out", 130, 130, 32, 2.7, 0.0, "CC", 16.9891, 3.6),
    ("cut_out", 40, 40, 2, 0.7, 0.0, "FSM", 4.4461, 2.2),
    ("cut_out", 50, 50, 7, 0.9, 0.0, "CC", None, None),
    ("deceleration", 108, 108, 0, 0.0, 0.9, "RSS", 1.5275, 5.4),
    ("deceleration", 110, 110, 0, 0.0, 0.9, "FSM", None, None),
]
# Published collisions of whole grids, and at one pair of speeds.
COUNTS = [
    pytest.param(
        "cut_in_low", {"CC": 3728, "RSS": 880, "FSM": 901, "Reg157": 2252}, marks=pytest.mark.exhaustive
    ),
    pytest.param(
        "cut_in_high", {"CC": 3552, "RSS": 1491, "FSM": 1649, "Reg157": 2869}, marks=pytest.mark.exhaustive
    ),
    ("cut_out", {"CC": 848, "RSS": 936, "FSM": 980}),
    ("deceleration", {"CC": 0, "RSS": 21, "FSM": 0}),
]
PAIR = [
    ("cut_in_low", 60, 20, {"CC": 378, "RSS": 108, "FSM": 109, "Reg157": 241}),
    ("cut_in_high", 110, 40, {"CC": 345, "RSS": 117, "FSM": 132, "Reg157": 265}),
]


def point(case, ego, other, distance, lateral, deceleration) -> Points:
    lateral = round(lateral * 10) * 0.1  # the grid's own value, to the last bit
    columns = (np.array([float(v)]) for v in (ego, other, distance, lateral, deceleration))
    return Points(case, *columns)


@pytest.mark.parametrize("published", PUBLISHED)
def test_single_points_come_out_as_published(published):
    *where, name, speed, time = published
    made = drive(point(*where), MODELS[name](stated=False))
    assert made.contact[0] == (speed is not None)
    if speed is not None:
        assert made.speed[0] == pytest.approx(speed, abs=1e-3)
        assert made.time[0] == pytest.approx(time)


@pytest.mark.parametrize("case, counts", COUNTS)
def test_whole_grids_collide_as_often_as_published(case, counts):
    points = grid(case)
    for name, count in counts.items():
        made = int(drive(points, MODELS[name](stated=False)).contact.sum())
        assert abs(made - count) <= 0.01 * count, name


@pytest.mark.parametrize("case, ego, other, counts", PAIR)
def test_one_pair_of_speeds_collides_as_often_as_published(case, ego, other, counts):
    points = grid(case)
    points = points.at((points.ego == ego) & (points.other == other))
    for name, count in counts.items():
        made = int(drive(points, MODELS[name](stated=False)).contact.sum())
        assert abs(made - count) <= 0.01 * count, name


@pytest.mark.thinned(3)
@pytest.mark.parametrize("reading", [True, False])
@pytest.mark.parametrize("case, name", PAIRS)
def test_the_fast_form_and_the_readable_one_agree(case, name, reading):
    points = grid(case)
    rows = np.random.default_rng(7).choice(len(points), 5, replace=False)
    points = points.at(rows)
    made = drive(points, MODELS[name](stated=reading))
    for i, values in enumerate(zip(*points.columns, strict=True)):
        one = drive_one(case, *map(float, values), name, stated=reading)
        assert one.contact == made.contact[i], points.words(i)
        assert one.peak == pytest.approx(made.peak[i], abs=1e-3), points.words(i)
        if one.contact:
            assert (one.time, one.impact) == pytest.approx((made.time[i], made.impact[i]), abs=1e-6)
            assert one.sideways == made.sideways[i]


def test_who_keeps_on_hits_a_lead_that_stands_at_full_speed():
    points = grid("deceleration")
    made = keep(points)
    assert made.contact.all()
    stop = points.ego * KMH / (points.deceleration * GRAVITY)
    stands = made.time > stop
    assert stands.any()
    assert made.impact[stands] == pytest.approx((points.ego * KMH)[stands])
    # the gap of 2 s and the way the lead still makes
    way = 2.0 * points.ego * KMH + 0.5 * (points.ego * KMH) * stop
    assert made.time[stands] == pytest.approx((way / (points.ego * KMH))[stands], abs=0.026)


@pytest.mark.parametrize("case", ["cut_out", "deceleration"])
def test_braking_never_makes_it_worse_behind_somebody(case):
    points = grid(case, 8)
    never = keep(points)
    for model in MODELS.values():
        if case.startswith(model.cases):
            made = drive(points, model())
            assert not (made.contact & ~never.contact).any()
            both = made.contact & never.contact
            assert (made.impact[both] <= never.impact[both] + 1e-9).all()


@pytest.mark.parametrize("case", list(CASES))
def test_nobody_brakes_harder_than_the_model_does(case):
    limits = {"CC": 0.85 * GRAVITY, "RSS": 0.774 * GRAVITY, "FSM": 6.0, "Reg157": 6.0}
    points = grid(case, 30)
    for name, model in MODELS.items():
        if case.startswith(model.cases):
            assert drive(points, model()).peak.max() <= limits[name] + 1e-9


def test_a_cut_in_that_never_comes_is_no_conflict():
    points = grid("cut_in_low")
    still = points.at(points.lateral == 0.0)
    assert not keep(still).contact.any()
    for model in MODELS.values():
        assert drive(still, model()).peak.max() == 0.0


def test_sideways_contacts_begin_beside_each_other():
    points = grid("cut_in_low", 15)
    made, others = keep(points), stated(points, 0.025, 35.0)
    for i in np.flatnonzero(made.contact)[::10]:
        before = round(made.time[i] / 0.025) - 1
        assert made.sideways[i] == (others.offset[before, i] >= WIDTH - 1e-9)


def test_grids_are_those_of_the_published_comparison():
    assert [len(grid(case)) for case in CASES] == [15_930, 14_040, 5_850, 1_121]
    assert len(grid("cut_in_low", 5)) == 3_240
    with pytest.raises(ConfigError, match="no case"):
        grid("overtaking")
    with pytest.raises(ConfigError, match="1 or more"):
        grid("cut_out", 0)


def test_the_table_and_the_rows_say_the_same():
    results = [by_models(grid("cut_in_high", 40))]
    table = table_of(results, "x").to_markdown()
    rows = rows_of(results).decode().splitlines()
    for name, fate in results[0].fates.items():
        mine = [row.split(",") for row in rows if row.split(",")[6] == name]
        assert len(mine) == len(results[0].points)
        assert sum(row[7] == "yes" for row in mine) == fate.struck.sum()
        assert f"| {name} | {len(mine):,} | {fate.struck.sum():,} |" in table


def test_a_panel_for_each_policy():
    points = grid("cut_in_low", 10)
    figure = picture(by_models(points.at((points.ego == 60) & (points.other == 20))), (60, 20))
    assert [axes.get_title() for axes in figure.axes] == list(MODELS)


def test_the_command_writes_table_points_and_pictures(tmp_path, capsys):
    assert main(["r157", "--case", "deceleration", "--stride", "6", "--out", str(tmp_path / "out")]) == 0
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["deceleration.png", "points.csv", "table.md"]
    assert "never" in capsys.readouterr().out


@pytest.mark.parametrize(
    "given, said",
    [
        (["--stride", "0"], "--stride is 0"),
        (["--pair", "60", "20"], "--pair belongs to"),
        (["--compare", "x.csv", "--stride", "2"], "--stride has no effect"),
        (["--compare", "there-is-none.csv"], "cannot be read"),
    ],
)
def test_what_cannot_be_is_said_in_a_sentence(given, said, capsys):
    assert main(["r157", *given]) == 2
    assert said in capsys.readouterr().err


def test_published_results_are_told_apart_by_their_columns(tmp_path):
    counts = tmp_path / "counts.csv"
    counts.write_text(
        "scenario,ego_kmh,other_kmh,model,n_points,n_collisions\ncut_out,130,130,CC_human_driver,450,196\n"
    )
    assert "| cut-out | CC | 5,850 | 196 | 196 | +0.00 % | 0 |" in compare(counts).to_markdown()
    single = tmp_path / "single.csv"
    single.write_text(
        "scenario,model,ego_speed_kmh,other_speed_kmh,dx0_m,lat_vel_mps,lead_decel_g,front_distance_m,"
        "collision,impact_ego_speed_mps\ncut_in,FSM,60,40,4.0,1.3,,,yes,12.4017\n"
    )
    assert "| cut-in | FSM | 1 | 1 | 100.0 % | 1 of 1 |" in compare(single).to_markdown()
    for content, said in (
        ("a,b\n1,2\n", "holds neither"),
        (counts.read_text() + "cut_out,x,1,RSS,1,1\n", "a row"),
    ):
        bad = tmp_path / "bad.csv"
        bad.write_text(content)
        with pytest.raises(ScenarioError, match=said):
            compare(bad)


def test_a_point_as_a_scene_is_the_point():
    pytest.importorskip("commonroad")
    from repair.r157.scenario import scene_at

    points = grid("cut_in_low", 5)
    row = 1234
    scene = scene_at(points, row, 4.0)
    others = stated(points.at(np.array([row])), 0.1, 4.0)
    assert (scene.vehicle.length, scene.vehicle.width) == (LENGTH, WIDTH)
    assert scene.initial_state.velocity == pytest.approx(points.ego[row] * KMH)
    (other,) = scene.scenario.dynamic_obstacles
    for k in (0, 7, 40):
        x, y = other.state_at_time(k).position
        assert x == pytest.approx(others.rear[k, 0] + LENGTH)
        assert y == pytest.approx(others.offset[k, 0])
    assert math.isclose(scene.horizon, 4.0)
