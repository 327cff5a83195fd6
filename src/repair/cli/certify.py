"""``repair certify``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass


# -- certify, sweep, tables, figures ---------------------------------------------------------------


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
