"""F-TTR as a function of the horizon: a later end of the repair changes little, and never comb-like.

Ends that are no whole number of knot spacings once lost the repair, and the next one had it again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.roads import car, lanelet, problem, scenario, state

import repair
from repair.curves.bases import fitted_knots

TENTHS = tuple(np.round(np.arange(5.0, 8.95, 0.1), 6).tolist())  # 40 of them
BACKENDS = ("ego", "casadi", "qptr")
TWO_LANES = lanelet(
    1, range(-60, 341, 20), [0.0] * 21, more='<adjacentLeft ref="2" drivingDir="same"/>'
) + lanelet(2, range(-60, 341, 20), [3.5] * 21, more='<adjacentRight ref="1" drivingDir="same"/>')
ONE_LANE = lanelet(1, range(-60, 341, 20), [0.0] * 21)


def standing(end: float, dt: float) -> str:
    """A car that stands 60 m ahead of an ego at 12 m/s."""
    shape = "<shape><rectangle><length>4.5</length><width>1.8</width></rectangle></shape>"
    place = state(60.0, 0.0, leave=("velocity", "acceleration"))
    return f'<staticObstacle id="30"><type>parkedVehicle</type>{shape}{place}</staticObstacle>'


def braking(end: float, dt: float) -> str:
    """A car 30 m ahead that brakes from 12 m/s with 3 m/s² until it stands."""
    t = np.minimum(np.arange(round(end / dt) + 1) * dt, 4.0)
    states = [
        state(30.0 + 12.0 * x - 1.5 * x**2, 0.0, k=k, v=12.0 - 3.0 * x, tag="state" if k else "initialState")
        for k, x in enumerate(t.tolist())
    ]
    return car(30, states[0], f"<trajectory>{''.join(states[1:])}</trajectory>")


def f_ttrs(folder: Path, traffic, road: str, backend: str, horizons, *settings: str, dt: float = 0.1) -> list:
    """F-TTR for each horizon, at which what is known of the traffic ends too."""
    found = []
    for end in horizons:
        k = round(end / dt)
        time = f"<time><intervalStart>{k - 1}</intervalStart><intervalEnd>{k}</intervalEnd></time>"
        task = problem(100, state(0.0, 0.0, v=12.0), f"<goalState>{time}</goalState>")
        path = folder / "horizon.xml"
        text = scenario(road=road, obstacles=traffic(end, dt), problems=task, dt=dt)
        path.write_text(text, encoding="utf-8")
        keys = ["reference.source=constant", f"repair.horizon={end}", *settings]
        result = repair.repair(path, backend=backend, overrides=keys)
        assert result.prepared.t_end == pytest.approx(end)
        found.append(result.f_ttr)
    return found


@pytest.mark.thinned(3)
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_standing_car_on_one_lane(backend: str, tmp_path: Path) -> None:
    horizons = TENTHS[::3] if backend == "casadi" else TENTHS  # odd tenths and even ones; all: exhaustive
    found = f_ttrs(tmp_path, standing, ONE_LANE, backend, horizons)
    assert found == [pytest.approx(found[0])] * len(horizons)
    room, most = 60.0 - 0.5 * 4.5 - 0.5 * 4.298, 11.5  # between the bumpers [m]; the Ford's brakes [m/s²]
    assert 3.6 - 1e-9 <= found[0] <= (room - 12.0**2 / (2.0 * most)) / 12.0


@pytest.mark.exhaustive
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("road", [ONE_LANE, TWO_LANES], ids=["one-lane", "two-lanes"])
@pytest.mark.parametrize("traffic", [standing, braking])
@pytest.mark.parametrize("spacing", [0.2, 0.4, 0.5])
@pytest.mark.parametrize("dt", [0.04, 0.05, 0.1, 0.2])
def test_no_teeth(backend: str, road: str, traffic, spacing: float, dt: float, tmp_path: Path) -> None:
    steps = range(round(5.0 / dt), round(8.9 / dt) + 1, 1 if dt > 0.05 else 3 if dt < 0.05 else 2)
    settings = [f"{'qptr' if backend == 'qptr' else 'repair'}.spacing={spacing}", "search.delta_t=0.2"]
    horizons = [round(k * dt, 6) for k in steps]
    found = f_ttrs(tmp_path, traffic, road, backend, horizons, *settings, dt=dt)
    assert None not in found
    assert max(found) - min(found) < 0.2 + 1e-9, list(zip(horizons, found, strict=True))


@pytest.mark.exhaustive
def test_no_teeth_without_widening(tmp_path: Path) -> None:
    """What is asked again with larger margins may not be what hides a tooth."""
    for spacing in (0.2, 0.4, 0.5):
        settings = f"repair.spacing={spacing}", "repair.widen=[]", "search.delta_t=0.2"
        found = f_ttrs(tmp_path, braking, ONE_LANE, "ego", TENTHS, *settings)
        assert None not in found
        assert max(found) - min(found) < 0.2 + 1e-9


@pytest.mark.parametrize(
    "duration, points, spacing",
    [(4.0, 13, 0.4), (1.2000000000000002, 6, 0.4), (4.1, 14, 4.1 / 11), (0.3, 4, 0.3), (0.0, 4, 0.4)],
)
def test_knots_fit_the_duration(duration: float, points: int, spacing: float) -> None:
    n, fitted = fitted_knots(duration, 0.4, 3)
    assert n == points
    assert fitted == (spacing if spacing == 0.4 else pytest.approx(spacing, rel=1e-9, abs=1e-12))
    assert (n - 3) * fitted == pytest.approx(duration or 0.4)
