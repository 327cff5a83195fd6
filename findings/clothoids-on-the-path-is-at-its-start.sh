#!/usr/bin/env bash
# clothoids: a car exactly on its path, or 1 m beyond its end, has the path coordinates (0, 0), those of the path's start.
#
# Expected: findST1 gives arc length and lateral offset of a place, the inverse of eval_ISO: on the path the offset is 0 and the arc length
# that of the place. Beyond an end it is an extrapolation (as eval_ISO does), the nearest end, or a refusal: NaN, an exception, a flag.
# What happens: with 1 mm or 2 m of offset all of 1000 places on a winding path of 110 m are right. Exactly on the path 865 of them are
# answered with (0, 0), at 1 micrometre beside it 42, with no sign that something is amiss; their neighbours are right. Beyond the
# ends the answer is (0, 0) as well, whatever the distance and the lateral offset, so that s drops from 110 m to 0 when a drive
# passes the end. closest_point_ISO of the same object is right everywhere, and on a straight path so are places on it.
# Why it matters: a reference that is projected onto itself, a start state taken from the path, or a perfect tracker is the usual first
# test; a car with a little noise never shows it.
#
# Output seen:
#   clothoids 2.0.33
#   straight path of 100.0 m, 0 m beside it: findST1 wrong at 0 of 1000 places, (0, 0) at 0, closest_point_ISO at 0
#   straight path of 100.0 m, 1e-06 m beside it: findST1 wrong at 0 of 1000 places, (0, 0) at 0, closest_point_ISO at 0
#   straight path of 100.0 m, 0.001 m beside it: findST1 wrong at 0 of 1000 places, (0, 0) at 0, closest_point_ISO at 0
#   straight path of 100.0 m, 2 m beside it: findST1 wrong at 0 of 1000 places, (0, 0) at 0, closest_point_ISO at 0
#   winding path of 110.2 m, 0 m beside it: findST1 wrong at 865 of 1000 places, (0, 0) at 865, closest_point_ISO at 0
#   winding path of 110.2 m, 1e-06 m beside it: findST1 wrong at 42 of 1000 places, (0, 0) at 42, closest_point_ISO at 0
#   winding path of 110.2 m, 0.001 m beside it: findST1 wrong at 0 of 1000 places, (0, 0) at 0, closest_point_ISO at 0
#   winding path of 110.2 m, 2 m beside it: findST1 wrong at 0 of 1000 places, (0, 0) at 0, closest_point_ISO at 0
#   mirrored path of 110.2 m, 0 m beside it: findST1 wrong at 875 of 1000 places, (0, 0) at 875, closest_point_ISO at 0
#   mirrored path of 110.2 m, 1e-06 m beside it: findST1 wrong at 50 of 1000 places, (0, 0) at 50, closest_point_ISO at 0
#   mirrored path of 110.2 m, 0.001 m beside it: findST1 wrong at 0 of 1000 places, (0, 0) at 0, closest_point_ISO at 0
#   mirrored path of 110.2 m, 2 m beside it: findST1 wrong at 0 of 1000 places, (0, 0) at 0, closest_point_ISO at 0
#   winding path, -20.0 m along and 0 m beside: findST1 0.0 m and 0.0 m, closest_point_ISO 0.0 m along
#   winding path, -1.0 m along and 2 m beside: findST1 0.0 m and 0.0 m, closest_point_ISO 0.0 m along
#   winding path, 110.3 m along and 2 m beside: findST1 0.0 m and 0.0 m, closest_point_ISO 110.2 m along
#   winding path, 111.2 m along and 0 m beside: findST1 0.0 m and 0.0 m, closest_point_ISO 110.2 m along
#   winding path, 130.2 m along and -2 m beside: findST1 0.0 m and 0.0 m, closest_point_ISO 110.2 m along
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps clothoids==2.0.33
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import Clothoids

print('clothoids', version('clothoids'))
WINDING = ((0, 0), (20, 5), (40, 0), (60, -10), (80, -5), (100, 10))


def path(places):
    """Clothoid list through places."""
    made = Clothoids.ClothoidList()
    made.build_G1([float(x) for x, _ in places], [float(y) for _, y in places])
    return made


def compare(line, beside):
    """Numbers of 1000 places at an offset that findST1 and closest_point_ISO have at another arc length, and of (0, 0)."""
    others = [0, 0, 0]
    for count in range(1000):
        station = (count + 0.5) / 1000 * line.length()
        place = line.eval_ISO(station, beside)
        found, nearest = line.findST1(*place), line.closest_point_ISO(*place)
        others[0] += abs(found[0] - station) > 1e-6
        others[1] += abs(nearest[2] - station) > 1e-6
        others[2] += tuple(found) == (0.0, 0.0)
    return others


ok = True
for words, places in (('straight', ((0, 0), (50, 0), (100, 0))), ('winding', WINDING),
                      ('mirrored', tuple((x, -y) for x, y in WINDING))):
    line = path(places)
    for beside in (0.0, 1e-6, 1e-3, 2.0):
        others = compare(line, beside)
        print(f'{words} path of {line.length():.1f} m, {beside:g} m beside it: findST1 wrong at {others[0]} of 1000 places, '
              f'(0, 0) at {others[2]}, closest_point_ISO at {others[1]}')
        ok = ok and others[1] == 0 and others[0] == others[2]
        ok = ok and (others[0] > 300 if beside == 0.0 and words != 'straight' else others[0] == 0 or 0.0 < beside < 1e-4)
line = path(WINDING)
length = line.length()
for station, beside in ((-20.0, 0.0), (-1.0, 2.0), (length + 0.1, 2.0), (length + 1.0, 0.0), (length + 20.0, -2.0)):
    place = line.eval_ISO(station, beside)
    found, nearest = line.findST1(*place), line.closest_point_ISO(*place)
    print(f'winding path, {station:.1f} m along and {beside:.0f} m beside: findST1 {found[0]:.1f} m and {found[1]:.1f} m, '
          f'closest_point_ISO {nearest[2]:.1f} m along')
    ok = ok and tuple(found) == (0.0, 0.0) and abs(nearest[2] - min(max(station, 0.0), length)) < 1e-6
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
