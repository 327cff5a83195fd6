#!/usr/bin/env bash
# UXsim: of two roads between the same two nodes half of the cars take the longer one, were it 48 km instead of 1.2 km; the delay is negative.
#
# Expected: drivers choose the quickest way; on an empty network the road of 1.2 km takes 60 s, a way round of 48 km is taken by nobody, and
# the average delay, the time lost against free flow, is 0.
# What happens: so it is if there is a node along the way round. Without one both roads are one entry in the matrix of travel times, and the cars
# are dealt to them half and half, whatever they cost: 12 km and 48 km alike, 357 and 1347 s on average. Free flow is
# that of the road that was added last: the average delay is -1053 s, or +1053 s with the two lines exchanged.
# Why it matters: a road and its service road, two carriageways, a bypass and the road through the town are two links between the same
# nodes in imported networks; a comparison of measures by delay counts the order of a file.
#
# Output seen:
#   uxsim 1.15.1
#   1.2 km or 2.0 km, a node along the way round, around added last: 0 of 600 cars take the way round, average travel time 60 s, delay +0 s
#   1.2 km or 2.0 km, no node between, around added last: 330 of 600 cars take the way round, average travel time 82 s, delay -18 s
#   1.2 km or 2.0 km, no node between, short added last: 270 of 600 cars take the way round, average travel time 78 s, delay +18 s
#   1.2 km or 12.0 km, a node along the way round, around added last: 0 of 600 cars take the way round, average travel time 60 s, delay +0 s
#   1.2 km or 12.0 km, no node between, around added last: 330 of 600 cars take the way round, average travel time 357 s, delay -243 s
#   1.2 km or 12.0 km, no node between, short added last: 270 of 600 cars take the way round, average travel time 303 s, delay +243 s
#   1.2 km or 48.0 km, a node along the way round, around added last: 0 of 600 cars take the way round, average travel time 60 s, delay +0 s
#   1.2 km or 48.0 km, no node between, around added last: 330 of 600 cars take the way round, average travel time 1347 s, delay -1053 s
#   1.2 km or 48.0 km, no node between, short added last: 270 of 600 cars take the way round, average travel time 1113 s, delay +1053 s
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
SHORT, SPEED = 1200.0, 20.0


def drive(around, node, last='around'):
    """Cars on the way round, cars in all, average travel time and delay, of 0.2 cars/s for 3000 s over two roads."""
    world = World(deltan=5, tmax=6000, print_mode=0, save_mode=0, show_mode=0, random_seed=0)
    for name in ('start', 'via', 'end'):
        world.addNode(name, 0, 0)

    def add(which):
        if which == 'short':
            world.addLink('short', 'start', 'end', length=SHORT, free_flow_speed=SPEED)
        elif node:
            world.addLink('around', 'start', 'via', length=around / 2.0, free_flow_speed=SPEED)
            world.addLink('rest', 'via', 'end', length=around / 2.0, free_flow_speed=SPEED)
        else:
            world.addLink('around', 'start', 'end', length=around, free_flow_speed=SPEED)

    for which in ('short', 'around') if last == 'around' else ('around', 'short'):
        add(which)
    world.adddemand('start', 'end', 0, 3000, flow=0.2)
    world.exec_simulation()
    world.analyzer.basic_analysis()
    links = world.analyzer.link_to_pandas().set_index('link').traffic_volume
    return int(links['around']), int(world.analyzer.trip_completed), float(world.analyzer.average_travel_time), float(world.analyzer.average_delay)


ok = True
for around in (2000.0, 12000.0, 48000.0):
    for node, last in ((True, 'around'), (False, 'around'), (False, 'short')):
        long, cars, time, delay = drive(around, node, last)
        print(f'1.2 km or {around / 1000.0:.1f} km, {"a node along the way round" if node else "no node between"}, {last} added last: {long} of {cars} cars take '
              f'the way round, average travel time {time:.0f} s, delay {delay:+.0f} s')
        ok = ok and cars == 600 and (long == 0 and time == 60.0 and delay == 0.0 if node else 0.4 < long / cars < 0.6)
        ok = ok and (node or (delay < -10.0 if last == 'around' else delay > 10.0))
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
