#!/usr/bin/env bash
# UXsim: an empty road of 1.2 km takes 60 s as one link, 120 s in 24 pieces, 300 s in 60 pieces.
#
# Expected: cutting a road into links changes nothing for a car that drives on it alone at 20 m/s: 60 s, no delay.
# What happens: a car enters at most one link in a time step, which is 5 s by default (the platoon of five times the reaction
# time of 1 s), so that each link shorter than 100 m takes 5 s. The average delay of free traffic is then up to 240 s and nothing is
# said; single cars (deltan=1) are right down to 20 m. A way round of 2 km is taken by half of the cars, since
# the cut road is seen to be slow after its first use, though both are empty.
# Why it matters: links of maps end at each side road and crossing, 20 to 80 m apart in towns; the town is crossed at walking pace, and
# a comparison with the same town drawn coarsely finds congestion where none is.
#
# Output seen:
#   uxsim 1.15.1
#   1 pieces of 1200 m: 60 s, delay 0 s; with single cars 60 s
#   12 pieces of 100 m: 60 s, delay 0 s; with single cars 60 s
#   24 pieces of 50 m: 120 s, delay 60 s; with single cars 60 s
#   60 pieces of 20 m: 300 s, delay 240 s; with single cars 60 s
#   12 pieces, or 2 km round (100 s): 0 % take the way round, average 60 s
#   24 pieces, or 2 km round (100 s): 44 % take the way round, average 111 s
#   60 pieces, or 2 km round (100 s): 60 % take the way round, average 180 s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps contourpy==1.3.3 cycler==0.12.1 dill==0.4.1 fonttools==4.68.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6 packaging==26.4 pandas==3.1.1 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0 scipy==1.17.1 six==1.17.0 tqdm==4.70.1 uxsim==1.15.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

from uxsim import World

print('uxsim', version('uxsim'))
ROAD, SPEED = 1200.0, 20.0


def drive(pieces, platoon, around=None):
    """Average travel time and delay, and share on the way round, of 0.2 cars/s for 500 s (3000 s with a way round)."""
    world = World(deltan=platoon, tmax=6000, print_mode=0, save_mode=0, show_mode=0, random_seed=0)
    for node in range(pieces + 1):
        world.addNode(str(node), node, 0)
    for piece in range(pieces):
        world.addLink(f'piece {piece}', str(piece), str(piece + 1), length=ROAD / pieces, free_flow_speed=SPEED)
    if around is not None:
        world.addNode('via', 0, 1)
        world.addLink('around', '0', 'via', length=around / 2.0, free_flow_speed=SPEED)
        world.addLink('rest', 'via', str(pieces), length=around / 2.0, free_flow_speed=SPEED)
    world.adddemand('0', str(pieces), 0, 500 if around is None else 3000, flow=0.2)
    world.exec_simulation()
    world.analyzer.basic_analysis()
    links, cars = world.analyzer.link_to_pandas().set_index('link').traffic_volume, world.analyzer.trip_completed
    return float(world.analyzer.average_travel_time), float(world.analyzer.average_delay), None if around is None else float(links['around'] / cars)


ok = True
for pieces in (1, 12, 24, 60):
    (time, delay, _), (single, _, _) = drive(pieces, 5), drive(pieces, 1)
    print(f'{pieces} pieces of {ROAD / pieces:.0f} m: {time:.0f} s, delay {delay:.0f} s; with single cars {single:.0f} s')
    expected = max(ROAD / SPEED, 5.0 * pieces)
    ok = ok and abs(time - expected) < 0.5 and abs(delay - (expected - 60.0)) < 0.5 and abs(single - 60.0) < 0.5
for pieces in (12, 24, 60):
    time, _, share = drive(pieces, 5, 2000.0)
    print(f'{pieces} pieces, or 2 km round (100 s): {100.0 * share:.0f} % take the way round, average {time:.0f} s')
    ok = ok and (share == 0.0 if pieces == 12 else share > 0.25 and time > 95.0)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
