"""``python -m tests.fuzz --count 2000 --seed 0 --dir $COMMONROAD_SCENARIOS``; status 1 if anything broke."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path


def main() -> int:
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=2000, help="number of inputs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--dir", type=Path, default=os.environ.get("COMMONROAD_SCENARIOS"), help="folder of CommonRoad files"
    )
    parser.add_argument("--limit", type=float, default=30.0, help="hard limit for one input [s]")
    parser.add_argument("--jobs", type=int, default=1, help="worker processes")
    parser.add_argument("--only", type=int, nargs="+", help="run the inputs with these numbers only")
    parser.add_argument("--keep", type=Path, help="folder for the inputs that broke something")
    arguments = parser.parse_args()
    from tests.fuzz.run import BUG, Outcome, Settings, fuzz, report, scenario_files

    files = scenario_files(arguments.dir) if arguments.dir is not None and arguments.dir.is_dir() else ()
    if not files:
        parser.error("name a folder with CommonRoad files by --dir or COMMONROAD_SCENARIOS")
    settings = Settings(files, arguments.seed, arguments.limit, arguments.keep, arguments.jobs)
    indices = arguments.only or range(arguments.count)
    done = 0

    def show(outcome: Outcome) -> None:
        nonlocal done
        done += 1
        if outcome.word == BUG or arguments.only:
            print(
                f"{outcome.index} {outcome.name}: {outcome.word} {outcome.detail}",
                file=sys.stderr,
                flush=True,
            )
        if done % 100 == 0:
            print(f"{done} of {len(indices)}", file=sys.stderr, flush=True)

    begin = time.perf_counter()
    outcomes = fuzz(indices, settings, show)
    report(outcomes)
    print(f"\n{len(outcomes)} inputs, seed {arguments.seed}, {time.perf_counter() - begin:.0f} s")
    return int(any(o.word == BUG for o in outcomes))


if __name__ == "__main__":
    sys.exit(main())
