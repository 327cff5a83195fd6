"""``repair sweep``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from repair.cli.arguments import UsageError


def sweep_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair sweep``."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of CommonRoad files")
    parser.add_argument(
        "--backend", action="extend", nargs="+", metavar="NAME", help="one or more (default: ego)"
    )
    parser.add_argument(
        "--reference", action="extend", nargs="+", metavar="SOURCE",
        help="one or more of planner, constant, accelerate, recorded (default: planner)",
    )  # fmt: skip
    parser.add_argument("--preset", metavar="NAME")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="extend", nargs="+", default=[], dest="overrides"
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        type=Path,
        help="store each row as it comes, in study.sqlite, and write sweep.csv and sweep.json",
    )
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="worker processes")
    parser.add_argument("--timeout", type=float, default=300.0, metavar="S", help="wall time for one row [s]")
    parser.add_argument(
        "--resume", action="store_true", help="go on with the rows that are stored in --out DIR"
    )
    parser.add_argument("--report", metavar="FILE.md", type=Path, help="write a report of the rows")
    parser.add_argument(
        "--certify",
        action="store_true",
        help="recompute every margin from the written files, as `repair certify`",
    )
    parser.add_argument("--no-official", action="store_true", help="leave CommonRoad's own checker out")


def sweep(arguments: argparse.Namespace) -> int:
    """Every file, backend and reference; prints the rows as CSV where no folder is given."""
    from repair.io.destination import require_folder
    from repair.reference.registry import names
    from repair.study.export import write_sweep
    from repair.study.rows import COLUMNS, SweepSettings
    from repair.study.run import sweep as run_sweep

    if arguments.jobs < 1:
        raise UsageError(f"--jobs is {arguments.jobs}; at least one worker process is needed")
    if not arguments.timeout > 0.0:
        raise UsageError(f"--timeout is {arguments.timeout:g} s; it has to be positive")
    for name in arguments.reference or []:
        if name not in (known := names()):
            raise UsageError(f"reference {name!r} is none of {', '.join(known)}")
    settings = SweepSettings(
        backends=arguments.backend or ["ego"], references=arguments.reference or ["planner"],
        preset=arguments.preset, overrides=arguments.overrides, official=not arguments.no_official,
        certify=arguments.certify, timeout=arguments.timeout, jobs=arguments.jobs,
    )  # fmt: skip
    for target in filter(None, (arguments.out, arguments.report and arguments.report.parent)):
        require_folder(target)
    if arguments.report is not None and arguments.report.is_dir():
        raise UsageError(f"the report {arguments.report} is a folder; the name of a file is wanted")
    if arguments.resume and arguments.out is None:
        raise UsageError("--resume goes on with what is stored in a folder; name it with --out")
    rows = run_sweep(arguments.folder, settings, out=arguments.out, resume=arguments.resume)
    if arguments.report is not None:
        from repair.io.files import write_files
        from repair.report.sweep import sweep_report

        chosen = (("backend", settings.backends), ("reference", settings.references))
        words = [f"--{k} {' '.join(v)}" for k, v in chosen]
        text = sweep_report(rows, f"repair sweep {arguments.folder.name} {' '.join(words)}")
        content = {arguments.report.name: text.encode("utf-8", "backslashreplace")}
        print(*write_files(arguments.report.parent, content))
    if arguments.out is None and arguments.report is None:
        import csv

        table = csv.DictWriter(sys.stdout, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    elif arguments.out is not None:
        for path in write_sweep(rows, arguments.out, settings, arguments.folder):
            print(path)
    return 0
