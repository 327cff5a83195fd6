#!/usr/bin/env bash
# asammdf, mf4-rs and mdfr: of one MDF4 file three readers give three speeds where it is invalid, and raw values for different formulas.
#
# Expected: samples that the logger marked as invalid (invalidation bits) are recognisable as such in every reader of the
# format; a channel whose physical value is a formula of the raw one (x^2, sqrt(x)) is the value of the formula, or an
# error says that the formula is not understood.
# What happens: asammdf leaves invalid samples out, without a gap in the index: the channel is shorter than its neighbours.
# mf4-rs gives NaN. mdfr gives what stands there: a car that drives 655 m/s while the sensor is lost. Of x^2 asammdf
# returns the raw value, of sqrt(x) mdfr does, both as the physical one and without an error; mf4-rs has both right.
# Why it matters: these are measurements of cars; the same script run with another reader takes lost sensors for
# speeds, or shifts one channel against the others, and squares or roots are missing without a word.
#
# Output seen:
#   asammdf 8.8.28
#   mf4-rs 3.7.0
#   mdfr 0.7.3
#   speed by asammdf: 20.00 20.00 18.00 18.00
#   speed by mf4-rs: 20.00 20.00 nan nan 18.00 18.00
#   speed by mdfr: 20.00 20.00 655.35 655.35 18.00 18.00
#   square by asammdf: 0.00 1.00 2.00 3.00 4.00 5.00
#   square by mf4-rs: 0.00 1.00 4.00 9.00 16.00 25.00
#   square by mdfr: 0.00 1.00 4.00 9.00 16.00 25.00
#   root by asammdf: 0.00 1.00 1.41 1.73 2.00 2.24
#   root by mf4-rs: 0.00 1.00 1.41 1.73 2.00 2.24
#   root by mdfr: 0.00 1.00 2.00 3.00 4.00 5.00
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps asammdf==8.8.28 attrs==26.1.0 canmatrix==1.2 chardet==7.7.0 click==8.5.1 contourpy==1.3.3 cycler==0.12.1 deflate==0.9.0 fonttools==4.68.0 isal==1.9.1 kiwisolver==1.5.1 lxml==6.1.3 lz4==4.4.5 matplotlib==3.11.2 mdfr==0.7.3 mf4-rs==3.7.0 numexpr==2.14.2 numpy==2.4.6 packaging==26.4 pandas==3.1.1 pillow==13.0.0 polars==2.1.0 polars-runtime-32==2.1.0 pyparsing==3.3.3 python-dateutil==4.0.0 typing_extensions==4.16.0 tzdata==2026.6 zstd==1.5.7.2 
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { tail -3 errors >&2; exit 1; }
from importlib.metadata import version

import mdfr
import mf4_rs
import numpy as np
from asammdf import MDF, Signal

for name in ('asammdf', 'mf4-rs', 'mdfr'):
    print(name, version(name))
time = 0.1 * np.arange(6)
speed = np.array([2000, 2000, 65535, 65535, 1800, 1800], dtype='u2')
lost = speed == 65535
counts = np.arange(6, dtype='f8')
made = MDF(version='4.10')
made.append([Signal(speed, time, name='speed', unit='m/s', conversion={'a': 0.01, 'b': 0.0}, invalidation_bits=lost),
             Signal(counts, time, name='square', conversion={'formula': 'X^2'}),
             Signal(counts, time, name='root', conversion={'formula': 'sqrt(X)'})])
made.save('drive.mf4', overwrite=True)
first, second, third = MDF('drive.mf4'), mf4_rs.Mdf('drive.mf4'), mdfr.Mdfr('drive.mf4')
third.load_all_channels_data_in_memory()
third.convert_all_channels()
read = {name: {'asammdf': np.asarray(first.get(name).samples, float), 'mf4-rs': np.asarray(second.read(name), float),
               'mdfr': np.asarray(third.get_channel_data(name), float)} for name in ('speed', 'square', 'root')}
for name, readers in read.items():
    for reader, values in readers.items():
        print(f'{name} by {reader}: ' + ' '.join(f'{value:.2f}' for value in values))


def same(values, expected):
    return len(values) == len(expected) and np.allclose(values, expected, equal_nan=True)


physical = 0.01 * speed
ok = same(read['speed']['asammdf'], physical[~lost]) and same(read['speed']['mf4-rs'], np.where(lost, np.nan, physical))
ok = ok and same(read['speed']['mdfr'], physical)
ok = ok and same(read['square']['asammdf'], counts) and all(same(read['square'][reader], counts**2) for reader in ('mf4-rs', 'mdfr'))
ok = ok and same(read['root']['mdfr'], counts) and all(same(read['root'][reader], np.sqrt(counts)) for reader in ('asammdf', 'mf4-rs'))
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
