"""``result.json`` and what stands beside it: written, and read back."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from repair.errors import RepairError
from repair.io.drawing_json import drawing_from, drawing_to_dict
from repair.outcome.data import Outcome

__all__ = ["DRAWING_FILE", "RESULT_FILE", "drawing_bytes", "load_result", "read_record", "to_json"]

RESULT_FILE, DRAWING_FILE = "result.json", "drawing.json"


def to_json(content: dict[str, Any]) -> str:
    """Strict JSON text, one key a line, number lists on one line."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    flat = re.compile(r"\[\s+((?:-?[\d.eE+-]+|null)(?:,\s+(?:-?[\d.eE+-]+|null))*)\s+\]")
    return flat.sub(lambda m: "[" + re.sub(r"\s+", " ", m.group(1)) + "]", text) + "\n"


def drawing_bytes(outcome: Outcome) -> bytes | None:
    """The content of ``drawing.json``; None where there is nothing to draw."""
    if outcome.drawing is None:
        return None
    return (
        json.dumps(drawing_to_dict(outcome.drawing), allow_nan=False, separators=(",", ":")) + "\n"
    ).encode()


def read_record(folder: Path) -> dict[str, Any]:
    """What the ``result.json`` in a folder holds.

    Raises
    ------
    RepairError
        If there is none, it cannot be read, or it is not the result of a repair.
    """
    file = folder / RESULT_FILE
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise RepairError(f"{folder} holds no {RESULT_FILE}") from error
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise RepairError(f"{file} cannot be read: {error}") from error
    if (
        not isinstance(content, dict)
        or "status" not in content
        or not isinstance(content.get("config"), dict)
    ):
        raise RepairError(f"{file} is not the result of a repair")
    return content


def load_result(folder: str | Path) -> Outcome:
    """The outcome that ``result.save(folder)`` or ``repair run --out`` wrote.

    Figures and tables can be made of it; nothing is driven or searched again.

    Parameters
    ----------
    folder : path

    Returns
    -------
    Outcome
        Without a drawing where the folder has none (results of earlier versions).

    Raises
    ------
    RepairError
        If a file is missing, cannot be read or is damaged; the sentence names it.
    """
    folder = Path(folder)
    record = read_record(folder)
    name = record.get("drawing_file")
    if name is None:
        return Outcome(record)
    file = folder / str(name)
    try:
        drawing = drawing_from(json.loads(file.read_text(encoding="utf-8")))
    except FileNotFoundError as error:
        raise RepairError(f"the drawing {file} of the result is not there any more") from error
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise RepairError(f"{file} cannot be read: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RepairError(f"{file} is damaged: {type(error).__name__} {error}") from error
    return Outcome(record, drawing)
