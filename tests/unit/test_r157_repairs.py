"""UN R157: repairs beside the driver models, and what is proven unavoidable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from repair.cli.command import main
from repair.r157.cases import CASES, KMH, LENGTH, WIDTH, grid
from repair.r157.drive import STEP, unavoidable
from repair.r157.motion import sight, stated
from repair.r157.repairs import MANNERS, Asked, unexplained, with_repairs
from repair.r157.results import by_models, contradicted, rows_of, table_of

MOST = 11.5


@pytest.mark.parametrize("case", list(CASES))
def test_no_model_avoids_what_is_proven(case):
    points = grid(case, 60)
    results = by_models(points)
    for name, fate in results.fates.items():
        assert not contradicted(results, fate).any(), name


def test_a_wrong_proof_is_noticed():
    points = grid("cut_in_low", 30)
    results = by_models(points)
    wrong = replace(results, proven=np.ones(len(points), dtype=bool))
    assert contradicted(wrong, results.fates["CC"]).any()


def test_no_speed_profile_avoids_what_is_proven():
    """Speeds drawn at random between the vehicle's limits, from the sight on."""
    points = grid("cut_in_high", 4)
    points = points.at(points.lateral > 1.2)
    points = points.at(unavoidable(points, MOST))
    assert len(points) > 3
    others, seen = stated(points, STEP, 6.0), sight(points)
    rng = np.random.default_rng(3)
    for _ in range(40):
        place, speed = np.zeros(len(points)), points.ego * KMH
        met = np.zeros(len(points), dtype=bool)
        gain = MOST * np.minimum(1.0, 4.755 / speed)
        for k in range(len(others.rear)):
            gap = others.rear[k] - place
            met |= (gap < 0.0) & (gap > -2.0 * LENGTH) & (others.offset[k] < WIDTH)
            if k % 8 == 0:
                wanted = np.where(rng.random(len(points)) < 0.7, -MOST, gain * rng.random(len(points)))
            pull = np.where(k * STEP >= seen, wanted, 0.0)
            after = np.maximum(speed + pull * STEP, 0.0)
            place, speed = place + 0.5 * (speed + after) * STEP, after
        assert met.all()


def test_braking_harder_leaves_less_that_is_unavoidable():
    points = grid("cut_in_low", 6)
    hard, soft = unavoidable(points, MOST), unavoidable(points, 7.593)
    assert not (hard & ~soft).any()
    assert 0 < hard.sum() < soft.sum()


def test_repairs_stand_beside_the_models():
    points = grid("cut_in_low", 12)
    # one that is easy, one that comes too near too fast, and one that never comes
    easy = (
        (points.ego == 60)
        & (points.other == 20)
        & (points.distance == 37)
        & (np.abs(points.lateral - 1.0) < 0.01)
    )
    near = (points.ego == 60) & (points.other == 10) & (points.distance == 13) & (points.lateral > 1.65)
    never = (points.ego == 60) & (points.other == 20) & (points.distance == 37) & (points.lateral == 0.0)
    points = points.at(easy | near | never)
    assert len(points) == 3
    results = with_repairs(points, Asked(("ego",)), quiet=True)
    order = [int(np.flatnonzero(points.at(np.arange(3)).lateral == v)[0]) for v in sorted(points.lateral)]
    still, wide, tight = order
    for manner in MANNERS:
        late, first = results.fates[f"ego {manner}"], results.fates[f"ego {manner}, at sight"]
        assert not late.struck[[still, wide]].any()
        assert late.begun[wide] >= sight(points)[wide]
        assert late.begun[wide] >= first.begun[wide]
        assert late.peak[wide] > first.peak[wide] > 0.0
        assert not contradicted(results, late).any()
    assert results.fates["ego 0.774 g"].struck[tight]
    assert results.fates["ego 0.774 g"].impact[tight] > 0.0
    assert results.fates["ego 0.774 g"].peak[wide] <= 0.774 * 9.81 + 1e-6
    assert not unexplained(results, "ego 0.774 g", ["CC", "RSS", "FSM", "Reg157"]).any()
    assert results.proof_asked is not None
    assert results.proof_asked[tight]
    assert "proven for any motion" in table_of([results], "x").to_markdown()
    assert rows_of([results]).count(b"ego swerve, at sight") == 3


@pytest.mark.parametrize(
    "given, said",
    [
        (["--jobs", "2"], "--jobs has no effect"),
        (["--backend", "ego", "--jobs", "0"], "--jobs is 0"),
        (["--backend", "nobody"], "is none of"),
        (["--backend", "ego", "--reading", "published"], "the regulation's reading"),
        (["--case", "cut_out", "--pair", "1", "2"], "no points at 1 and 2"),
    ],
)
def test_what_does_not_go_together_is_said(given, said, capsys):
    assert main(["r157", *given]) == 2
    assert said in capsys.readouterr().err
