#!/usr/bin/env bash
# MLTS-point-mass: a hill too steep for the engine, and bends banked by 17 degrees, change nothing about the fastest lap.
#
# Expected: a track may have elevation, slope and banking, so a lap counts gravity: where it climbs by 0.12 rad, 1.2 of the 5 m/s² that the engine
# gives are missing, and 0.6 rad cannot be climbed at all at constant speed. In bends banked inwards, by 0.3 rad, the car is faster.
# What happens: the three columns are used for the coordinates of the result only. The lap of an oval of 451 m takes the same time, to the last
# digit, when it is level, over hills of 0.12 and 0.6 rad, and with bends banked by 0.3 rad inwards or outwards. Over the hills the engine of
# 5 m/s² would have to give 6.2 and 10.5 m/s², and the path climbs by up to 83 m all the same.
# Why it matters: the result is a converged optimum and has the right heights, so a lap of a hilly or banked track looks as if they had counted.
#
# Output seen:
#   MLTS-point-mass 0.1.0
#   CasADi 3.8.2
#   level: success True, lap of 17.974864941181934 s, slowest 18.11 m/s, fastest 33.80 m/s, heights of 0.0 m, an engine of 5.00 m/s² needed
#   hills of 0.12 rad: success True, lap of 17.974864941181934 s, slowest 18.11 m/s, fastest 33.80 m/s, heights of 17.2 m, an engine of 6.17 m/s² needed
#   hills of 0.6 rad: success True, lap of 17.974864941181934 s, slowest 18.11 m/s, fastest 33.80 m/s, heights of 82.8 m, an engine of 10.54 m/s² needed
#   bends banked by 0.3 rad: success True, lap of 17.974864941181934 s, slowest 18.11 m/s, fastest 33.80 m/s, heights of 1.6 m, an engine of 5.00 m/s² needed
#   bends banked by -0.3 rad: success True, lap of 17.974864941181934 s, slowest 18.11 m/s, fastest 33.80 m/s, heights of 1.6 m, an engine of 5.00 m/s² needed
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps MLTS-point-mass==0.1.0 casadi==3.8.2 numpy==2.4.6 pandas==3.1.1 python-dateutil==4.0.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import contextlib
import io
from importlib.metadata import version

import numpy as np
import pandas as pd
from mlts_point_mass import MLTS

print('MLTS-point-mass', version('MLTS-point-mass'))
print('CasADi', version('casadi'))
RADIUS, STRAIGHT, RAMP, GRAVITY = 40.0, 100.0, 15.0, 9.81
ENGINE, BRAKE, GRIP = 5.0, 10.0, 10.0


def oval(slope=0.0, banking=0.0):
    """Two straights and two left bends; the one climbs and the other falls, so that the road closes."""
    length = 2.0 * STRAIGHT + 2.0 * np.pi * RADIUS
    s = np.linspace(0.0, length, 301)

    def bend(begin):
        """1 in a bend, 0 outside of it, straight in between."""
        return np.clip((s - begin) / RAMP + 0.5, 0.0, 1.0) * np.clip((begin + np.pi * RADIUS - s) / RAMP + 0.5, 0.0, 1.0)

    def along(values):
        return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2.0 * np.diff(s))])

    bends = bend(STRAIGHT / 2.0) + bend(1.5 * STRAIGHT + np.pi * RADIUS)
    curvature = bends * 2.0 * np.pi / along(bends)[-1]
    heading, climb = along(curvature), slope * np.cos(2.0 * np.pi * s / length)
    return pd.DataFrame({'abscissa': s, 'curvature': curvature, 'dir_mid_line': heading,
                         'x_mid_line': along(np.cos(climb) * np.cos(heading)), 'y_mid_line': along(np.cos(climb) * np.sin(heading)),
                         'width_no_kerbs_L': 6.0 + 0.0 * s, 'width_no_kerbs_R': 6.0 + 0.0 * s,
                         'elevation': along(np.sin(climb)), 'slope': climb, 'banking': banking * bends})


angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, 37)
diagram = pd.DataFrame([(speed, (BRAKE if angle < 0.0 else ENGINE) * np.sin(angle), GRIP * np.cos(angle))
                        for speed in np.arange(0.0, 81.0, 5.0) for angle in angles], columns=['V', 'ax', 'ay'])


def lap(track):
    """Fastest lap by the package's defaults, on cells of 2 m."""
    with contextlib.redirect_stdout(io.StringIO()):
        car = MLTS(track, {'W_total': 1.8, 'v_max': 70.0}, diagram)
        return car.solution(x0=[0.0, 0.0, 20.0, 0.0, 0.0], mesh=2.0, ipopt_options={'ipopt.print_level': 0, 'print_time': 0})


times, laps = [], []
for words, track in (('level', oval()), ('hills of 0.12 rad', oval(0.12)), ('hills of 0.6 rad', oval(0.6)),
                     ('bends banked by 0.3 rad', oval(banking=0.3)), ('bends banked by -0.3 rad', oval(banking=-0.3))):
    best = lap(track)
    needed = (best['ax'] + GRAVITY * np.sin(np.interp(best['abscissa'], track['abscissa'], track['slope']))).max()
    laps.append(best)
    times.append(float(best['time'][-1]))
    print(f'{words}: success {best["success"]}, lap of {times[-1]!r} s, slowest {best["V"].min():.2f} m/s, fastest {best["V"].max():.2f} m/s, '
          f'heights of {np.ptp(best["z_trj"]):.1f} m, an engine of {needed:.2f} m/s² needed')
ok = all(best['success'] for best in laps) and len(set(times)) == 1 and np.ptp(laps[2]['z_trj']) > 50.0
ok = ok and all(np.array_equal(best['V'], laps[0]['V']) for best in laps)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
