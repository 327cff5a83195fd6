#!/usr/bin/env bash
# pycrash: an oncoming car that brakes is faster in the crash and after it, and never stops.
#
# Expected: of two cars that meet head-on, first and second are names; one that brakes leaves the crash slower than one that does
# not, and stands a second later. Two equal cars that both brake part with equal speeds.
# What happens: the second car, which is the one with negative speed, gets no brake while it drives that way, or one that pushes it
# on while the crash force is larger. A heavy one of 30 mph goes on with 8.0 mph if it does not brake and with 8.8 mph if it
# brakes, a second after the crash still; as the first car it stands by then. Two equal cars that both brake part with
# 4.0 and 2.0 mph.
# Why it matters: delta-V and rest positions of a head-on crash with braking, which is what most are, depend on whom one
# calls the first; rear-end crashes, in which both drive forward, show nothing of it.
#
# Output seen:
#   pycrash 0.0.18
#   a second after it, nobody brakes: -14.1 and -8.0 mph
#   a second after it, the heavy one, first, brakes: +0.0 and +13.2 mph
#   a second after it, the heavy one, second, brakes: -15.0 and -8.8 mph
#   as they part, equal cars, nobody brakes: -3.1 and +3.1 mph
#   as they part, equal cars, both brake: -4.0 and +2.0 mph
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps arrow==1.4.0 binaryornot==0.6.0 certifi==2026.10.19.post1 charset-normalizer==3.5.3 click==8.5.1 contourpy==1.3.3 cookiecutter==2.7.1 cycler==0.12.1 fonttools==4.68.0 idna==3.20 Jinja2==3.1.6 kiwisolver==1.5.1 markdown-it-py==4.3.0 MarkupSafe==3.0.4 matplotlib==3.11.2 mdurl==0.1.2 narwhals==2.29.0 numpy==2.4.6 packaging==26.4 pandas==2.3.3 pillow==13.0.0 plotly==7.1.0 pycrash==0.0.18 Pygments==2.21.0 pyparsing==3.3.3 python-dateutil==4.0.0 python-slugify==9.2.0 pytz==2026.6 PyYAML==6.0.4 requests==2.34.2 rich==15.0.0 scipy==1.17.1 tabulate==0.10.0 text-unidecode==1.3 tqdm==4.70.1 tzdata==2026.6 urllib3==2.8.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import contextlib
import io
from importlib.metadata import version
from types import SimpleNamespace

with contextlib.redirect_stdout(io.StringIO()):
    from pycrash.sdof_model import SDOF_Model
print('pycrash', version('pycrash'))


def after(weights, brakes, until=1.0):
    """Speeds in mph when two cars, the first one driving forward, have met head-on with 30 mph each; until None: as they part."""
    cars = [SimpleNamespace(name=name, weight=weight, brake=brake, vx_initial=speed)
            for name, weight, brake, speed in zip('ab', weights, brakes, (30.0, -30.0))]
    inputs = {'name': 'head-on', 'cor': 0.1, 'k': 40000.0, 'tstop': until}
    with contextlib.redirect_stdout(io.StringIO()):
        motion = SDOF_Model(*cars, model_inputs=inputs).model
    return tuple(float(motion[column].iloc[-1]) / 1.46667 for column in ('v1', 'v2'))


LIGHT, HEAVY = 3000.0, 6000.0
rows = {}
for name, weights, brakes, until in (('a second after it, nobody brakes', (LIGHT, HEAVY), (0.0, 0.0), 1.0),
                                     ('a second after it, the heavy one, first, brakes', (HEAVY, LIGHT), (1.0, 0.0), 1.0),
                                     ('a second after it, the heavy one, second, brakes', (LIGHT, HEAVY), (0.0, 1.0), 1.0),
                                     ('as they part, equal cars, nobody brakes', (LIGHT, LIGHT), (0.0, 0.0), None),
                                     ('as they part, equal cars, both brake', (LIGHT, LIGHT), (1.0, 1.0), None)):
    first, second = rows[name] = after(weights, brakes, until)
    print(f'{name}: {first:+.1f} and {second:+.1f} mph')
free, brakes_first, brakes_second, coasting, braking = rows.values()
ok = abs(free[1] + 8.0) < 0.1 and abs(brakes_first[0]) < 0.1 and abs(brakes_second[1] + 8.8) < 0.1
ok = ok and abs(coasting[0] + coasting[1]) < 0.05 and abs(braking[0] + braking[1]) > 2.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
