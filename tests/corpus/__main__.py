"""``python -m tests.corpus FOLDER``: exit status 1 where something is not as it has to be."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from functools import partial
from pathlib import Path

from tests.corpus.examine import examine, lost
from tests.corpus.records import BACKENDS, REFERENCES, Examined, Settings
from tests.corpus.report import report, violated
from tests.workers import answers


def run(files: list[Path], settings: Settings, jobs: int, limit: float) -> list[Examined]:
    """Examine files in processes of their own, with progress on standard error; in the order of the files."""
    found: dict[str, Examined] = {}
    work = partial(examine, settings=settings)
    for number, one in enumerate(
        answers(files, work, partial(lost, settings=settings), jobs=jobs, limit=limit), start=1
    ):
        found[one.file] = one
        words = one.refused or ", ".join(sorted({d.kind for d in one.deviations})) or "as it should be"
        print(f"{number}/{len(files)} {one.file}: {words}", file=sys.stderr, flush=True)
    return [found[name] for name in sorted(found)]


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.corpus", description=main.__doc__)
    parser.add_argument("folder", type=Path, nargs="?", help="looked through with all folders in it")
    parser.add_argument("--maps", action="store_true", help="situations on maps of a public package")
    parser.add_argument("--count", type=int, default=200, help="situations of --maps (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of --maps")
    parser.add_argument("--keep", type=Path, help="folder for the situations of --maps")
    parser.add_argument("--backends", nargs="+", default=BACKENDS, metavar="NAME")
    parser.add_argument("--references", nargs="+", default=REFERENCES, metavar="SOURCE")
    parser.add_argument("--limit", type=int, help="the first so many files only")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=600.0, help="for one file [s]")
    parser.add_argument("--no-invariance", action="store_true", help="do not move, turn and mirror")
    parser.add_argument("--set", nargs="+", default=(), dest="overrides", metavar="KEY=VALUE")
    options = parser.parse_args(arguments)
    os.environ.setdefault("MPLBACKEND", "Agg")
    with tempfile.TemporaryDirectory() as aside:
        base = options.folder
        if options.maps:
            from tests.corpus.maps import NoMaps, situations

            base = options.keep or Path(aside)
            try:
                situations(base, options.count, options.seed)
            except NoMaps as reason:
                print(f"no maps: {reason}", file=sys.stderr)
                return 2
        if base is None or not base.is_dir():
            parser.error(f"{base} is not a folder")
        files = sorted(base.rglob("*.xml"))[: options.limit]
        others = sorted(f for f in base.rglob("*") if f.suffix in (".pb", ".proto"))
        if others:
            print(f"{len(others)} protobuf files are left out: XML is what is read", file=sys.stderr)
        if not files:
            parser.error(f"{base} has no *.xml file")
        settings = Settings(
            tuple(options.backends),
            tuple(options.references),
            not options.no_invariance,
            base,
            tuple(options.overrides),
        )
        examined = run(files, settings, options.jobs, options.timeout)
    print(report(examined))
    return int(bool(violated(examined)))


if __name__ == "__main__":
    raise SystemExit(main())
