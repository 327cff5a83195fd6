"""``repair certify``, ``report`` and ``animate``: what is asked of something written."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from repair.cli.arguments import UsageError

__all__ = ["animate", "animate_arguments", "certify", "certify_arguments", "report", "report_arguments"]


def certify_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair certify``."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="what `repair run --out DIR` wrote")


def certify(arguments: argparse.Namespace) -> int:
    """Exit status 1 where a margin is violated."""
    from repair.certify.certificate import format_certificate
    from repair.certify.recompute import certify as recompute

    certificate = recompute(arguments.folder)
    print(format_certificate(certificate))
    return 0 if certificate.ok else 1


def report_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair report``."""
    parser.add_argument(
        "folder", type=Path, metavar="DIR",
        help="what `repair study`, `repair sweep --out` or `repair run --out` wrote",
    )  # fmt: skip
    parser.add_argument(
        "--out", metavar="FILE.html", type=Path, help="where it is written (default: DIR/report.html)"
    )


def report(arguments: argparse.Namespace) -> int:
    """One page of HTML with all rows and their pictures."""
    from repair.io.files import write_files
    from repair.study.shown import page_of_result, page_of_study
    from repair.study.store import STORE_FILE

    folder: Path = arguments.folder
    target: Path = arguments.out or folder / "report.html"
    if target.is_dir():
        raise UsageError(f"the report {target} is a folder; the name of a file is wanted")
    made: Any = page_of_study if (folder / STORE_FILE).is_file() else page_of_result
    content = made(folder).encode("utf-8", "backslashreplace")
    print(*write_files(target.parent, {target.name: content}))
    return 0


def animate_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair animate``."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="what `repair run --out DIR` wrote")
    parser.add_argument(
        "--out", metavar="FILE", type=Path,
        help="a .gif, or an .mp4 where ffmpeg is there (default: DIR/animation.gif)",
    )  # fmt: skip


def animate(arguments: argparse.Namespace) -> int:
    """The result as a film, beside the plan as it was."""
    from functools import partial

    from tqdm import tqdm

    from repair.io.destination import require_folder
    from repair.io.files import write_files
    from repair.io.result_json import load_result
    from repair.report.film.animation import animation

    target: Path = arguments.out or arguments.folder / "animation.gif"
    if target.suffix not in (".gif", ".mp4"):
        raise UsageError(f"--out is {target.name}; a film is a .gif or an .mp4")
    require_folder(target.parent)
    outcome = load_result(arguments.folder)
    bar = partial(tqdm, desc="frames", disable=None, leave=False)
    print(*write_files(target.parent, {target.name: animation(outcome, target.suffix[1:], bar)}))
    return 0
