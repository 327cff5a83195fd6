"""``repair certify``, ``report`` and ``animate``: what is asked of something written."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.cli.arguments import UsageError

if TYPE_CHECKING:
    from repair.report.film.frames import Film

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
        help="what `repair study`, `repair sweep --out`, `repair simulate --out` or `repair run --out` wrote",
    )  # fmt: skip
    parser.add_argument(
        "--out", metavar="FILE.html", type=Path, help="where it is written (default: DIR/report.html)"
    )


def report(arguments: argparse.Namespace) -> int:
    """One page of HTML with all rows and their pictures."""
    from repair.io.files import write_files
    from repair.simulate.many.film import page_of_simulation
    from repair.study.shown import page_of_result, page_of_study
    from repair.study.store import STORE_FILE

    folder: Path = arguments.folder
    target: Path = arguments.out or folder / "report.html"
    if target.is_dir():
        raise UsageError(f"the report {target} is a folder; the name of a file is wanted")
    made: Any = page_of_study if (folder / STORE_FILE).is_file() else page_of_result
    if _holds_drives(folder):
        made = page_of_simulation
    content = made(folder).encode("utf-8", "backslashreplace")
    print(*write_files(target.parent, {target.name: content}))
    return 0


_CHOSEN = {
    "file": (str, "FILE", "of a simulation: the drive in this scenario"),
    "reference": (str, "SOURCE", "with this plan"),
    "shift": (float, "S", "with the traffic so much later [s]"),
    "prediction": (str, "NAME", "with this prediction"),
    "policy": (str, "NAME", "with this policy"),
}  # fmt: skip


def animate_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair animate``."""
    parser.add_argument(
        "folder", type=Path, metavar="DIR", help="what `repair run --out` or `repair simulate --out` wrote"
    )
    parser.add_argument(
        "--out", metavar="FILE", type=Path,
        help="a .gif, or an .mp4 where ffmpeg is there (default: DIR/animation.gif)",
    )  # fmt: skip
    for name, (kind, metavar, words) in _CHOSEN.items():
        parser.add_argument(f"--{name}", type=kind, metavar=metavar, help=words)


def _holds_drives(folder: Path) -> bool:
    from repair.simulate.measures import SIMULATION

    return (folder / SIMULATION.stored_in).is_file()


def animate(arguments: argparse.Namespace) -> int:
    """A result or a drive as a film, beside the plan as it was."""
    from functools import partial

    from tqdm import tqdm

    from repair.io.destination import require_folder
    from repair.io.files import write_files
    from repair.report.film.frames import animation

    target: Path = arguments.out or arguments.folder / "animation.gif"
    if target.suffix not in (".gif", ".mp4"):
        raise UsageError(f"--out is {target.name}; a film is a .gif or an .mp4")
    require_folder(target.parent)
    bar = partial(tqdm, desc="frames", disable=None, leave=False)
    print(*write_files(target.parent, {target.name: animation(_film(arguments), target.suffix[1:], bar)}))
    return 0


def _film(arguments: argparse.Namespace) -> Film:
    from repair.io.result_json import load_result
    from repair.report.film.result import film_of_result
    from repair.simulate.many.film import film_in

    wanted = {name: getattr(arguments, name) for name in _CHOSEN}
    if arguments.file is not None and not arguments.file.endswith(".xml"):
        wanted["file"] = f"{arguments.file}.xml"
    if not _holds_drives(arguments.folder):
        if given := [f"--{name}" for name, value in wanted.items() if value is not None]:
            raise UsageError(f"{' '.join(given)} has no effect on a result")
        return film_of_result(load_result(arguments.folder))
    film, words = film_in(
        arguments.folder, {("shift_s" if n == "shift" else n): v for n, v in wanted.items()}
    )
    print(words)
    return film
