"""What the checker calls feasible is what the certificate certifies and CommonRoad's own checks accept."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from repair.certify.limits import physical_rows
from repair.certify.motion import States
from repair.check.limits import vehicle_excess
from repair.scene.road.sections import endless
from repair.vehicle.parameters import load_vehicle
from repair.world.road import RoadBoundary

VEHICLE = load_vehicle(1)


def states(rng, share):
    """States of a drive with random accelerations and steering, up to a share of what the vehicle has."""
    count, dt = 12, 0.1
    speed = np.cumsum(np.r_[rng.uniform(0.5, 15.0), rng.uniform(-1.0, 1.0, count) * share * 11.5 * dt])
    speed = np.maximum(speed, 0.01)
    steering = np.cumsum(rng.uniform(-0.2, 0.2, count + 1)) * share
    slip = np.arctan(VEHICLE.rear / VEHICLE.wheelbase * np.tan(steering))
    return np.arange(count + 1) * dt, speed, slip, steering


@pytest.mark.thinned(4)
@pytest.mark.parametrize("seed", range(40))
def test_the_vehicle_is_asked_for_the_same_as_by_the_certificate(seed):
    """Grip, engine and steering, at the states that are written: two formulas, one verdict."""
    rng = np.random.default_rng(seed)
    t, speed, slip, steering = states(rng, rng.uniform(0.1, 1.5))
    axle = speed * np.cos(slip)
    made = States(np.arange(len(t)), np.zeros((len(t), 2)), np.zeros(len(t)), axle, steering)
    names = ("vehicle: engine and brakes", "vehicle: grip of the tyres", "vehicle: steering angle")
    rows = {row.name: row.ok for row in physical_rows(made, 0.1, VEHICLE)}
    assert bool(vehicle_excess(t, speed, slip, VEHICLE)) == (not all(rows[name] for name in names))


def lanelet(name, left, right, **beside):
    """Return a lanelet of straight bounds along x, from 0 to 60 m."""
    from commonroad.scenario.lanelet import Lanelet

    x = np.linspace(0.0, 60.0, 7)
    bounds = [np.column_stack([x, np.full(7, y)]) for y in (left, 0.5 * (left + right), right)]
    return Lanelet(bounds[0], bounds[1], bounds[2], name, **beside)


def boundary(lanelets, gap):
    from commonroad.scenario.lanelet import LaneletNetwork

    network = LaneletNetwork.create_from_lanelet_list(lanelets)
    return RoadBoundary(SimpleNamespace(lanelet_network=network), VEHICLE, gap)


def test_a_lanelet_whose_left_bound_is_on_its_right_is_no_road():
    """As for the drivability checker: the ring around it and its neighbour crosses itself."""
    proper = lanelet(1, 1.75, -1.75, adjacent_right=2, adjacent_right_same_direction=True)
    twisted = lanelet(2, -5.25, -1.75, adjacent_left=1, adjacent_left_same_direction=True)
    region = boundary([proper, twisted], 0.0).region
    assert region.contains(shapely.Point(30.0, 0.0))
    assert not region.contains(shapely.Point(30.0, -3.5))


@pytest.mark.parametrize("wide", [0.1, 0.3])
def test_who_crosses_a_gap_that_counts_as_road_is_told(wide):
    road = boundary([lanelet(1, 3.5, 0.0), lanelet(2, -wide, -3.5)], 0.35)
    x, along, across = np.array([20.0, 30.0]), np.array([1.75, 1.75]), np.array([1.75, 0.0])
    assert road.over_a_gap(x, along, np.zeros(2)) is None
    _, words, _ = road.over_a_gap(x, across, np.zeros(2))
    assert "crosses a gap of the map at (30.0, " in words
    assert road.first_off_road(x, across, np.zeros(2)) is None
    assert boundary([lanelet(1, 3.5, 0.0)], 0.0).over_a_gap(x, across, np.zeros(2)) is None


def test_neighbours_that_lead_back_are_noticed():
    def linked(name, left, right, same=True):
        return SimpleNamespace(
            lanelet_id=name, adj_left=left, adj_right=right, adj_left_same_direction=same,
            adj_right_same_direction=same,
        )  # fmt: skip

    def network(*lanelets):
        return SimpleNamespace(lanelets=lanelets)

    assert not endless(network(linked(1, 2, None), linked(2, 3, 1), linked(3, None, 2)))
    assert not endless(network(linked(1, 2, None, False), linked(2, 1, None, False)))  # one beside the other
    assert not endless(network(linked(1, 9, None)))  # who is not on the map
    assert endless(network(linked(1, 2, None), linked(2, 1, None)))
    assert endless(network(linked(1, None, 3), linked(2, 3, 1), linked(3, 1, 2)))
