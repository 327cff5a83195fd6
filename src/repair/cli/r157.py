"""``repair r157``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from repair.cli.arguments import UsageError

if TYPE_CHECKING:
    from repair.r157.cases import Points
    from repair.r157.results import Results

__all__ = ["r157", "r157_arguments"]


def r157_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair r157``."""
    from repair.r157.cases import CASES

    parser.add_argument(
        "--case", action="extend", nargs="+", choices=tuple(CASES), metavar="CASE",
        help=f"one or more of {', '.join(CASES)} (default: all)",
    )  # fmt: skip
    parser.add_argument(
        "--stride", type=int, default=1, metavar="N", help="every N-th distance of the grids (default: 1)"
    )
    parser.add_argument(
        "--reading", choices=("stated", "published"), default="stated",
        help="the regulation's own text, or the numerics of a published implementation (default: stated)",
    )  # fmt: skip
    parser.add_argument(
        "--compare", metavar="FILE", type=Path,
        help="published results (CSV) beside the published reading, and nothing else",
    )  # fmt: skip
    parser.add_argument(
        "--pair",
        type=int,
        nargs=2,
        metavar="V",
        help="of one --case, the points at these speeds of ego and other alone [km/h]",
    )
    parser.add_argument(
        "--backend", action="extend", nargs="+", metavar="NAME",
        help="repairs as well, by one or more backends, and proofs where nothing avoids it",
    )  # fmt: skip
    parser.add_argument("--jobs", type=int, metavar="N", help="processes for repairs and proofs (default: 1)")
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="write table.md, points.csv and a picture for each case"
    )


def r157(arguments: argparse.Namespace) -> int:
    """The cases of UN R157 by driver models; prints the table."""
    if arguments.stride < 1:
        raise UsageError(f"--stride is {arguments.stride}; it has to be at least 1")
    if arguments.compare is not None:
        return _compared(arguments)
    _require(arguments)
    from repair.io.destination import require_folder
    from repair.r157.cases import CASES
    from repair.r157.results import by_models, table_of

    if arguments.out is not None:
        require_folder(arguments.out)
    published = arguments.reading == "published"
    chosen = [_points(case, arguments) for case in arguments.case or list(CASES)]
    if arguments.backend:
        from repair.r157.repairs import Asked, with_repairs

        asked = Asked(tuple(dict.fromkeys(arguments.backend)), arguments.jobs or 1)
        results = [with_repairs(points, asked) for points in chosen]
    else:
        results = [by_models(points, published=published) for points in chosen]
    words = "a published implementation" if published else "the regulation's text"
    table = table_of(results, f"UN R157 in the reading of {words}").to_markdown()
    sys.stdout.write(table)
    if arguments.out is not None:
        _write(arguments, results, table)
    return 0


def _require(arguments: argparse.Namespace) -> None:
    """What does not go together."""
    from repair.solvers.registry import backend_names

    if arguments.pair is not None and len(arguments.case or []) != 1:
        raise UsageError("--pair belongs to one --case")
    if arguments.jobs is not None and not arguments.backend:
        raise UsageError("--jobs has no effect without --backend")
    if arguments.jobs is not None and arguments.jobs < 1:
        raise UsageError(f"--jobs is {arguments.jobs}; it has to be at least 1")
    if arguments.backend and arguments.reading == "published":
        raise UsageError("repairs (--backend) are made in the regulation's reading")
    for name in arguments.backend or []:
        if name not in backend_names():
            raise UsageError(f"backend {name!r} is none of {', '.join(backend_names())}")


def _points(case: str, arguments: argparse.Namespace) -> Points:
    from repair.r157.cases import grid

    points = grid(case, arguments.stride)
    if arguments.pair is None:
        return points
    ego, other = arguments.pair
    chosen = (points.ego == ego) & (points.other == other)
    if not chosen.any():
        raise UsageError(f"{case} has no points at {ego} and {other} km/h")
    return points.at(chosen)


def _compared(arguments: argparse.Namespace) -> int:
    from repair.r157.compare import compare

    given = {"--case": arguments.case, "--out": arguments.out, "--pair": arguments.pair,
             "--backend": arguments.backend, "--jobs": arguments.jobs,
             "--stride": arguments.stride if arguments.stride != 1 else None,
             "--reading": arguments.reading if arguments.reading != "stated" else None}  # fmt: skip
    if wrong := [name for name, value in given.items() if value is not None]:
        raise UsageError(f"{' '.join(wrong)} has no effect with --compare")
    sys.stdout.write(compare(arguments.compare).to_markdown())
    return 0


def _write(arguments: argparse.Namespace, results: list[Results], table: str) -> None:
    from repair.io.files import write_files
    from repair.r157.picture import SHOWN, picture
    from repair.r157.results import rows_of
    from repair.report.style import render

    files = {"table.md": table.encode(), "points.csv": rows_of(results)}
    for one in results:
        pair = tuple(arguments.pair) if arguments.pair is not None else SHOWN[one.points.case]
        files[f"{one.points.case}.png"] = render(picture(one, pair))
    for path in write_files(arguments.out, files):
        print(path)
