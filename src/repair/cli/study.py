"""``repair study``."""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING

from repair.cli.arguments import UsageError

if TYPE_CHECKING:
    from repair.study.plan import Study

__all__ = ["study", "study_arguments"]


def study_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair study``."""
    parser.add_argument(
        "what", nargs="+", metavar="STUDY.yaml",
        help="the study; or `export DIR`, which writes the rows of one that was run",
    )  # fmt: skip
    parser.add_argument(
        "--out", metavar="DIR", type=Path,
        help="where its rows are stored (default: a folder with the name of the study, here)",
    )  # fmt: skip
    parser.add_argument("--workers", metavar="N", type=int, help="processes on this machine (default: 1)")
    parser.add_argument(
        "--dask", metavar="ADDRESS", help="the workers of a Dask cluster instead: tcp://HOST:8786"
    )
    parser.add_argument("--resume", action="store_true", help="go on with the rows that are there")
    parser.add_argument("--limit", metavar="N", type=int, help="make at most N rows now")
    parser.add_argument(
        "--dry-run", action="store_true", help="say how many rows there are to make, and make none"
    )
    parser.add_argument("--format", choices=("csv", "parquet"), help="of `export` (default: csv)")


def study(arguments: argparse.Namespace) -> int:
    """A study, or the export of one."""
    if arguments.what[0] == "export":
        return _export(arguments)
    if len(arguments.what) > 1:
        raise UsageError(f"one study is wanted, and not {' '.join(arguments.what)}")
    if arguments.format is not None:
        raise UsageError("--format belongs to `repair study export DIR`")
    if arguments.workers is not None and arguments.dask is not None:
        raise UsageError("give either --workers or --dask, not both")
    if arguments.workers is not None and arguments.workers < 1:
        raise UsageError(f"--workers is {arguments.workers}; at least one is needed")
    if arguments.limit is not None and arguments.limit < 1:
        raise UsageError(f"--limit is {arguments.limit}; it has to be at least 1")
    with ExitStack() as kept:
        return _run(arguments, _read(arguments.what[0], kept))


def _read(file: str, kept: ExitStack) -> Study:
    """The study; bundled scenarios are there as long as ``kept`` is open."""
    from repair.paper.bundled import find_scenario
    from repair.study.read import read_study

    return read_study(file, lambda name: kept.enter_context(find_scenario(name)))


def _run(arguments: argparse.Namespace, chosen: Study) -> int:
    from repair.io.destination import require_folder
    from repair.study.cluster import ClusterLanes
    from repair.study.engine import Lanes, LocalLanes
    from repair.study.plan import tasks_of
    from repair.study.run import estimate, run_study
    from repair.study.store import STORE_FILE, Store

    source = Path(arguments.what[0])
    out = arguments.out or Path(source.stem)
    require_folder(out)
    tasks = tasks_of(chosen)
    there = (out / STORE_FILE).is_file()
    workers = arguments.workers or 1
    if arguments.dry_run:
        with ExitStack() as opened:
            store = opened.enter_context(Store(out, readonly=True)) if there else None
            told = estimate(tasks, store, workers, arguments.limit)
            spread = (
                "by all workers of the cluster together" if arguments.dask is not None else _with(workers)
            )
            print(_words(len(tasks), *told, arguments.limit, spread))
        return 0
    lanes: Lanes
    lanes = ClusterLanes(arguments.dask) if arguments.dask is not None else LocalLanes(workers)
    with closing(lanes), Store(out) as store:
        if not arguments.resume and store.done():
            raise UsageError(f"{out} holds rows already; --resume goes on, --out names another folder")
        store.tell(study=source.read_text(encoding="utf-8"), command=f"repair study {source.name}")
        try:
            ran = run_study(tasks, store, lanes, limit=arguments.limit)
        except KeyboardInterrupt:
            done = sum(task["done"] for task in store.tasks())
            words = f"repair: interrupted; {done} of {_rows(len(tasks))} are stored in {store.path}"
            print(f"{words}, and --resume goes on", file=sys.stderr)
            return 130
        left = f"; {ran.left} are left, and --resume goes on" if ran.left else ""
        print(f"{_rows(ran.made)} made, {ran.before} were there{left}")
        print(store.path)
    return 0


def _with(workers: int) -> str:
    return f"with {workers} worker{'s' if workers > 1 else ''}"


def _rows(count: int) -> str:
    return f"{count} row{'s' if count != 1 else ''}"


def _words(total: int, done: int, seconds: float | None, limit: int | None, spread: str) -> str:
    """What a dry run says."""
    text = f"{_rows(total)}, {done} of them there, {total - done} to make"
    if total == done:
        return text
    if limit is not None and limit < total - done:
        text += f", {limit} of them now"
    if seconds is None:
        return f"{text}; no row is there yet that says how long they take (--limit 10 makes some)"
    return f"{text}: about {seconds:.0f} s {spread}"


def _export(arguments: argparse.Namespace) -> int:
    from repair.io.files import write_files
    from repair.study.export import export
    from repair.study.store import Store

    if len(arguments.what) != 2:
        raise UsageError("repair study export takes one folder")
    given = {"--dask": arguments.dask, "--workers": arguments.workers, "--limit": arguments.limit,
             "--resume": arguments.resume or None, "--dry-run": arguments.dry_run or None}  # fmt: skip
    if wrong := [name for name, value in given.items() if value is not None]:
        raise UsageError(f"{' '.join(wrong)} has no effect on an export")
    folder = Path(arguments.what[1])
    with Store(folder, readonly=True) as store:
        name, content = export(store, arguments.format or "csv")
        missing = sum(not task["done"] for task in store.tasks())
    if missing:
        print(f"repair: {missing} rows of the study are not there yet", file=sys.stderr)
    print(*write_files(arguments.out or folder, {name: content}), sep="\n")
    return 0
