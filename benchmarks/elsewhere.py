"""An environment of its own for a package that cannot be, or need not be, in ours."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
_DONE = "requirements.txt"  # in the environment's folder, once everything is installed


def environment(folder: Path, requirements: Path) -> Path:
    """The interpreter of an environment, which is built where it is not there yet.

    Parameters
    ----------
    folder : Path
        Where it is, or is to be.
    requirements : Path
        Everything that is needed, pinned; what the packages ask for beyond it is not installed.
    """
    python, done = folder / "bin" / "python", folder / _DONE
    wanted = requirements.read_text(encoding="utf-8")
    if done.is_file() and done.read_text(encoding="utf-8") == wanted:
        return python
    print(f"building an environment in {folder}", file=sys.stderr)
    subprocess.run([sys.executable, "-m", "venv", "--clear", str(folder)], check=True, env=_clean())
    install = ["-m", "pip", "install", "-q", "--disable-pip-version-check", "--no-deps", "-r"]
    subprocess.run([str(python), *install, str(requirements)], check=True, env=_clean())
    done.write_text(wanted, encoding="utf-8")
    return python


def told(python: Path, module: str, *arguments: str) -> list[dict[str, Any]]:
    """What a module of ours prints there: the lines that are JSON objects."""
    done = subprocess.run(
        [str(python), "-m", module, *arguments], check=True, text=True, cwd=ROOT, stdout=subprocess.PIPE,
        env=_clean() | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def _clean() -> dict[str, str]:
    """This process' environment variables, without what is about its own packages."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
