#!/usr/bin/env bash
# rtamt, sentil, mstlo, metric-temporal-logic: of one recording and one rule monitors give +2 and -1, kept for ever and broken.
#
# Expected: "the gap is 10 m or more for the next second" has one margin on one recording; where samples are lost or the recording
# ends before the rule's window, monitors say so, or differ a little.
# What happens: gaps of 13, 12 and 9 m at 0, 0.5 and 2 s have the margin +2 (last value kept), +1 (interpolated) or -1 (rtamt in
# discrete time, which counts samples; sentil online, which looks back a second from the sample that closes the window).
# Sampled at 0.4 s a rule broken by 1 m offline is kept by 2 m for sentil's own online monitor, which never looks at
# the window of the first sample. For a window after the end, "always" is +inf, -1 or unanswered, "eventually" -inf, -1 or unanswered.
# Why it matters: these margins rank scenarios and drive falsification; with another monitor, or the same one offline and
# online, the same drive obeys the rule or breaks it, and all say so without a warning.
#
# Output seen:
#   rtamt 0.4.10
#   mstlo-python 0.2.2
#   sentil 0.3.1
#   metric-temporal-logic 0.4.1
#   a sample lost, always[0, 1]: rtamt dense +2.0, rtamt discrete -1.0, sentil +2.0, sentil dense +1.0, sentil online -1.0, mstlo +2.0, mtl +2.0
#   every 0.4 s, eventually[0, 1]: rtamt dense -1.0, rtamt discrete -1.0, sentil -1.0, sentil dense +0.5, sentil online +2.0, mstlo -1.0, mtl -1.0
#   ends at 2 s, always[3, 4]: rtamt dense -1.0, rtamt discrete +inf, sentil +inf, sentil dense -1.0, sentil online none, mstlo none, mtl none
#   ends at 2 s, eventually[3, 4]: rtamt dense -1.0, rtamt discrete -inf, sentil -inf, sentil dense -1.0, sentil online none, mstlo none, mtl none
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps antlr4-python3-runtime==4.7 attrs==22.2.0 discrete-signals==0.8.3 funcy==1.18 lenses==0.5.0 metric-temporal-logic==0.4.1 mstlo-python==0.2.2 numpy==2.4.6 parsimonious==0.9.0 regex==2026.11.19 rtamt==0.4.10 sentil==0.3.1 singledispatch==4.1.2 sortedcontainers==2.4.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import logging
import warnings
from importlib.metadata import version

import mstlo_python
import mtl
import rtamt
import sentil

warnings.simplefilter('ignore')
logging.disable(logging.CRITICAL)
for name in ('rtamt', 'mstlo-python', 'sentil', 'metric-temporal-logic'):
    print(name, version(name))
WORDS = {'always': 'G', 'eventually': 'F'}


def rtamt_of(kind, rule, bounds, times, gaps):
    spec = kind()
    spec.declare_var('gap', 'float')
    spec.declare_var('margin', 'float')
    spec.spec = f'margin = {rule}[{bounds[0]}, {bounds[1]}](gap >= 10)'
    if kind is rtamt.StlDiscreteTimeSpecification:
        spec.set_sampling_period(500, 'ms', 0.1)
        spec.parse()
        return spec.evaluate({'time': times, 'gap': gaps})[0][1]
    spec.parse()
    return spec.evaluate(['gap', [list(pair) for pair in zip(times, gaps)]])[0][1]


def sentil_of(kind, rule, bounds, times, gaps):
    text = f'{rule}[{bounds[0]}, {bounds[1]}](gap >= 10)'
    if kind == 'online':
        monitor = sentil.OnlineMonitor(text)
        verdicts = [monitor.update(time, {'gap': gap}) for time, gap in zip(times, gaps)]
        return next((verdict.value for verdict in verdicts if verdict.resolved), None)
    trace = sentil.Trace(times, {'gap': gaps})
    return getattr(sentil.Formula.parse(text), kind)(trace)


def mstlo_of(rule, bounds, times, gaps):
    monitor = mstlo_python.Monitor(mstlo_python.parse_formula(f'{WORDS[rule]}[{bounds[0]}, {bounds[1]}](gap >= 10)'),
                                   semantics='DelayedQuantitative')
    return dict(monitor.update_batch({'gap': list(zip(gaps, times))}).verdicts()).get(0.0)



def mtl_of(rule, bounds, times, gaps):
    rule = mtl.parse(f'{WORDS[rule]}[{bounds[0]}, {bounds[1]}] margin')
    margins = {'margin': [(time, gap - 10.0) for time, gap in zip(times, gaps)]}
    return dict(rule(margins, quantitative=True, time=None)).get(0.0)


MONITORS = {
    'rtamt dense': lambda *case: rtamt_of(rtamt.StlDenseTimeSpecification, *case),
    'rtamt discrete': lambda *case: rtamt_of(rtamt.StlDiscreteTimeSpecification, *case),
    'sentil': lambda *case: sentil_of('robustness', *case),
    'sentil dense': lambda *case: sentil_of('robustness_dense', *case),
    'sentil online': lambda *case: sentil_of('online', *case),
    'mstlo': mstlo_of, 'mtl': mtl_of}
CASES = {
    'a sample lost, always[0, 1]': ('always', (0, 1), [0.0, 0.5, 2.0], [13.0, 12.0, 9.0]),
    'every 0.4 s, eventually[0, 1]': ('eventually', (0, 1), [0.0, 0.4, 0.8, 1.2, 1.6], [7.0, 8.0, 9.0, 12.0, 14.0]),
    'ends at 2 s, always[3, 4]': ('always', (3, 4), [0.0, 0.5, 1.0, 1.5, 2.0], [14.0, 12.0, 9.0, 8.0, 9.0]),
    'ends at 2 s, eventually[3, 4]': ('eventually', (3, 4), [0.0, 0.5, 1.0, 1.5, 2.0], [14.0, 12.0, 9.0, 8.0, 9.0])}
seen = {}
for name, case in CASES.items():
    for monitor, margin in MONITORS.items():
        try:
            seen[name, monitor] = margin(*case)
        except (ValueError, rtamt.RTAMTException) as error:
            seen[name, monitor] = type(error).__name__
    print(name + ': ' + ', '.join(f'{monitor} ' + ('none' if seen[name, monitor] is None else f'{seen[name, monitor]:+.1f}'
          if isinstance(seen[name, monitor], float) else seen[name, monitor]) for monitor in MONITORS))
INF = float('inf')
expected = {'a sample lost, always[0, 1]': (2.0, -1.0, 2.0, 1.0, -1.0, 2.0, 2.0),
            'every 0.4 s, eventually[0, 1]': (-1.0, -1.0, -1.0, 0.5, 2.0, -1.0, -1.0),
            'ends at 2 s, always[3, 4]': (-1.0, INF, INF, -1.0, None, None, None),
            'ends at 2 s, eventually[3, 4]': (-1.0, -INF, -INF, -1.0, None, None, None)}
ok = all(seen[name, monitor] == margin or (None not in (seen[name, monitor], margin) and abs(seen[name, monitor] - margin) < 1e-6)
         for name, margins in expected.items() for monitor, margin in zip(MONITORS, margins))
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
