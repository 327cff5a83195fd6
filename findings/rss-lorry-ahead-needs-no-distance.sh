#!/usr/bin/env bash
# ad-rss-lib: behind a lorry that brakes less than the car can, any distance is safe, also one that is hit.
#
# Expected: the safe distance behind another vehicle is so large that nothing happens if it brakes as hard as it can
# and the car behind still accelerates for its response time and then brakes. Both at 30 m/s, the lorry braking by
# 4 m/s² and the car, after 1 s, by 8 m/s²: 10.8 m (they are closest 2.9 s after the lorry begins to brake).
# What happens: only the places where both come to rest are compared. The car stops 10 m before the lorry does, so
# that the distance is 0, and at 0.5 m as at 5 m the situation check finds the car safe and asks for no response.
# In the course that is meant it is 10.3 m and 5.8 m inside of the lorry. With equal brakes the distance is right.
# Why it matters: the library gives every object its own dynamics, for lorries, trams and motorcycles. Where
# brake_max of the one ahead is below brake_min of the one behind, its answer is no bound.
#
# Output seen:
#   ad-rss 5.0.0
#   car, brakes of 8 m/s² ahead and 8 m/s² behind: safe distance 45.64 m, needed 45.65 m (closest after 5.2 s)
#     at 0.5 m: dangerous, response BrakeMin, and 45.1 m inside of the other
#     at 5.0 m: dangerous, response BrakeMin, and 40.6 m inside of the other
#   lorry, brakes of 4 m/s² ahead and 8 m/s² behind: safe distance 0.00 m, needed 10.78 m (closest after 2.9 s)
#     at 0.5 m: safe, response None, and 10.3 m inside of the other
#     at 5.0 m: safe, response None, and 5.8 m inside of the other
#   tram, brakes of 3 m/s² ahead and 6 m/s² behind: safe distance 0.00 m, needed 10.29 m (closest after 3.2 s)
#     at 0.5 m: safe, response None, and 9.8 m inside of the other
#     at 5.0 m: safe, response None, and 5.3 m inside of the other
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps ad-rss==5.0.0 ad-physics==3.0.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

from ad_rss import physics, rss

print('ad-rss', version('ad-rss'))
rss.core.setLogLevel('off')
SPEED, ACCELERATE, RESPONSE = 30.0, 3.5, 1.0


def vehicle(brake_max, brake_min):
    """A vehicle at 30 m/s on a straight lane; brakes are given as positive decelerations."""
    state = rss.core.RelativeObjectState()
    state.object_type = rss.world.ObjectType.OtherVehicle
    d = rss.world.RssDynamics()
    d.alpha_lon.accel_max = physics.Acceleration(ACCELERATE)
    d.alpha_lon.brake_max = physics.Acceleration(-brake_max)
    d.alpha_lon.brake_min = physics.Acceleration(-brake_min)
    d.alpha_lon.brake_min_correct = physics.Acceleration(-min(3.0, brake_min))
    d.alpha_lat.accel_max, d.alpha_lat.brake_min = physics.Acceleration(0.2), physics.Acceleration(-0.8)
    d.lateral_fluctuation_margin = physics.Distance(0.0)
    d.response_time = physics.Duration(RESPONSE)
    d.max_speed_on_acceleration = physics.Speed(100.0)
    d.min_longitudinal_safety_distance = physics.Distance(0.0)
    u = d.unstructured_settings
    u.pedestrian_turning_radius, u.vehicle_min_radius = physics.Distance(2.0), physics.Distance(3.5)
    u.drive_away_max_angle, u.vehicle_yaw_rate_change = physics.Angle(2.4), physics.AngularAcceleration(0.3)
    u.vehicle_trajectory_calculation_step = physics.Duration(0.2)
    state.dynamics = d
    s = state.structured_object_state
    s.velocity.speed_lon_min = s.velocity.speed_lon_max = physics.Speed(SPEED)
    s.velocity.speed_lat_min = s.velocity.speed_lat_max = physics.Speed(0.0)
    s.has_priority, s.is_in_correct_lane = False, True
    s.distance_to_enter_intersection = s.distance_to_leave_intersection = physics.Distance(1000.0)
    o = state.unstructured_object_state
    o.yaw = o.steering_angle = physics.Angle(0.0)
    o.yaw_rate = physics.AngularVelocity(0.0)
    o.dimension.length, o.dimension.width = physics.Distance(4.0), physics.Distance(2.0)
    o.center_point.x = o.center_point.y = physics.Distance(0.0)
    o.speed_range.minimum = o.speed_range.maximum = physics.Speed(SPEED)
    return state


def needed(lead_brakes, ego_brakes, dt=1e-4):
    """The largest that the car comes closer by, and when, by driving both."""
    t, front, rear, v_front, v_rear, closest = 0.0, 0.0, 0.0, SPEED, SPEED, (0.0, 0.0)
    while v_rear > 0.0:
        front += v_front * dt
        rear += v_rear * dt
        v_front = max(0.0, v_front - lead_brakes * dt)
        v_rear = max(0.0, v_rear + (ACCELERATE if t < RESPONSE else -ego_brakes) * dt)
        t += dt
        closest = max(closest, (rear - front, t))
    return closest


def judged(lead, ego, gap):
    """Whether the situation check finds the ego safe, and what it asks for."""
    both = rss.core.RelativeConstellation()
    both.constellation_id, both.ego_id, both.object_id = 1, 1, 2
    both.constellation_type = rss.world.ConstellationType.SameDirection
    both.ego_state, both.other_state = ego, lead
    both.relative_position.longitudinal_position = rss.core.LongitudinalRelativePosition.AtBack
    both.relative_position.longitudinal_distance = physics.Distance(gap)
    both.relative_position.lateral_position = rss.core.LateralRelativePosition.names['Overlap']
    both.relative_position.lateral_distance = physics.Distance(0.0)
    scene, states = rss.core.RssSituationSnapshot(), rss.state.RssStateSnapshot()
    scene.time_index, scene.default_ego_vehicle_rss_dynamics = 1, ego.dynamics
    scene.constellations = rss.core.RelativeConstellationVector()
    scene.constellations.append(both)
    assert rss.core.RssSituationChecking().checkSituation(scene, states)
    state = states.individual_responses[0]
    assert rss.state.isDangerous(state) != state.longitudinal_state.is_safe
    return state.longitudinal_state.is_safe, str(state.longitudinal_state.response)


ok = True
for name, lead_brakes, ego_brakes in (('car', 8.0, 8.0), ('lorry', 4.0, 8.0), ('tram', 3.0, 6.0)):
    lead, ego = vehicle(lead_brakes, min(3.0, lead_brakes)), vehicle(9.0, ego_brakes)
    distance = physics.Distance(0.0)
    ok = ok and rss.structured.calculateSafeLongitudinalDistanceSameDirection(lead, ego, distance)
    closer, when = needed(lead_brakes, ego_brakes)
    print(f'{name}, brakes of {lead_brakes:.0f} m/s² ahead and {ego_brakes:.0f} m/s² behind: safe distance '
          f'{distance.mDistance:.2f} m, needed {closer:.2f} m (closest after {when:.1f} s)')
    for gap in (0.5, 5.0):
        safe, response = judged(lead, ego, gap)
        print(f'  at {gap} m: {"safe" if safe else "dangerous"}, response {response}, and {closer - gap:.1f} m inside of the other')
        ok = ok and safe == (lead_brakes < ego_brakes) and response == ('None' if safe else 'BrakeMin')
    ok = ok and (abs(distance.mDistance - closer) < 0.02 if lead_brakes == ego_brakes else
                 distance.mDistance == 0.0 and closer > 10.0)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
