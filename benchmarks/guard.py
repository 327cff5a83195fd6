"""The regression guard: whole searches against the literal transcription, as ratios, never as times.

    python -m benchmarks.guard            compares with ratios.json; exit status 1 if one has fallen
    python -m benchmarks --record         writes ratios.json

Both run the literal transcription and the backends in turns on the bundled Scenario 1, by CPU time; what
else the machine does hits both alike. A ratio counts as fallen if it is below 60 % of the recorded one in
three attempts out of three.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path

if __name__ == "__main__":  # before NumPy is loaded
    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[_name] = "1"

RATIOS = Path(__file__).with_name("ratios.json")
BACKENDS = ("ego", "qptr", "casadi sqpmethod")
MARGIN = 0.4  # share of the recorded ratio that may be lost: interpreters and BLAS differ by half of that
ATTEMPTS = 3
ROUNDS = 7


class Searches:
    """The searches that are compared, made once."""

    def __init__(self) -> None:
        from benchmarks.cases import Context, case

        with tempfile.TemporaryDirectory(prefix="repair-guard-") as folder:
            path = Context(folder=Path(folder)).path(1, bundled=True)
            self.made = {name: case(path, 1, name) for name in BACKENDS}

    def ratios(self, rounds: int = ROUNDS) -> dict[str, float]:
        """How many times less CPU time each backend's search takes than the literal one: medians."""
        from benchmarks.measure import ratio, together

        calls = {"literal": self.made["ego"].literal, **{name: c.search for name, c in self.made.items()}}
        times = together(calls, rounds, shortest=0.03)
        return {name: ratio(times["literal"], times[name]).median for name in self.made}


def record() -> int:
    """Write the ratios of this version."""
    from benchmarks.machine import describe

    machine = describe()
    content = {
        "ratios": {name: round(value, 2) for name, value in Searches().ratios(2 * ROUNDS + 1).items()},
        "measured_on": {key: machine[key] for key in ("processor", "python", "versions")},
    }
    RATIOS.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print("\n".join(f"{name:18} {value:7.2f} x" for name, value in content["ratios"].items()))
    print(f"recorded in {RATIOS}")
    return 0


def fallen(measured: dict[str, float], recorded: dict[str, float]) -> list[str]:
    """Names whose ratio has lost more than the margin."""
    return [name for name, value in recorded.items() if measured[name] < (1.0 - MARGIN) * value]


def check() -> int:
    """Compare with what was recorded; 0 if nothing has fallen."""
    recorded = json.loads(RATIOS.read_text(encoding="utf-8"))["ratios"]
    searches, best = Searches(), dict.fromkeys(recorded, 0.0)
    for attempt in range(1, ATTEMPTS + 1):
        measured = searches.ratios()
        best = {name: max(best[name], measured[name]) for name in recorded}
        for name, value in recorded.items():
            least = (1.0 - MARGIN) * value
            print(f"{name:18} {measured[name]:7.2f} x   recorded {value:7.2f} x   at least {least:7.2f} x")
        if not fallen(best, recorded):
            return 0
        print(f"attempt {attempt} of {ATTEMPTS}: {', '.join(fallen(best, recorded))} slower than recorded")
    print("If this is meant, record the new ratios: python -m benchmarks --record")
    return 1


if __name__ == "__main__":
    import warnings

    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    sys.exit(check())
