"""``result.json`` and what stands beside it: written, and read back."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from repair.errors import RepairError, in_words, path_of
from repair.io.drawing_json import drawing_from, drawing_to_dict
from repair.io.record_check import Damage, require_record
from repair.outcome.data import Outcome

__all__ = [
    "DRAWING_FILE", "RESULT_FILE", "drawing_bytes", "load_result", "read_record", "record_in", "scenario_of",
    "to_json",
]  # fmt: skip

RESULT_FILE, DRAWING_FILE = "result.json", "drawing.json"


def to_json(content: dict[str, Any]) -> str:
    """Strict JSON text, one key a line, number lists on one line.

    It can be written as UTF-8 whatever it holds: what is left of a file name that is no UTF-8 is escaped.
    """
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    flat = re.compile(r"\[\s+((?:-?[\d.eE+-]+|null)(?:,\s+(?:-?[\d.eE+-]+|null))*)\s+\]")
    text = flat.sub(lambda m: "[" + re.sub(r"\s+", " ", m.group(1)) + "]", text) + "\n"
    return text.encode("utf-8", "backslashreplace").decode("utf-8")  # \udcff: JSON's own notation


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
        If there is none, it cannot be read, is not the result of a repair, or was edited so that it holds
        what no repair writes; the sentence names the key.
    """
    folder = path_of(folder, "the folder of a result", RepairError)
    file = folder / RESULT_FILE
    try:
        if folder.is_file():
            raise RepairError(f"{folder} is a file; the folder is wanted that holds {RESULT_FILE}")
        if not file.exists():
            raise RepairError(f"{folder} holds no {RESULT_FILE}")
    except OSError as error:
        raise RepairError(f"{file} cannot be read: {error.strerror or error}") from error
    return record_in(file)


def record_in(file: Path) -> dict[str, Any]:
    """What a file holds that ``repair run --out`` or ``--json`` wrote.

    Raises
    ------
    RepairError
        As :func:`read_record`.
    """
    content = _read(file)
    if (
        not isinstance(content, dict)
        or "status" not in content
        or not isinstance(content.get("config"), dict)
    ):
        raise RepairError(f"{file} is not the result of a repair")
    try:
        require_record(content)
    except Damage as error:
        raise RepairError(f"{file} is damaged: {error}") from error
    return content


def scenario_of(folder: Path, content: Mapping[str, Any]) -> Path:
    """The file of the scenario that a result was made from: the one beside it, or where it came from.

    Raises
    ------
    RepairError
        If it is not there any more, or is another one by its checksum.
    """
    origin = content.get("provenance") or {}
    beside = content.get("scenario_file")
    if not beside and not origin.get("path"):
        why = content.get("scenario_file_problem")
        raise RepairError(
            f"{folder} does not hold the scenario that the result was made from" + (f": {why}" if why else "")
        )
    path = folder / beside if beside else Path(str(origin["path"]))
    if not path.is_file():
        raise RepairError(f"the scenario {path} of the result is not there any more")
    wanted = origin.get("sha256") or content.get("scenario_sha256")
    if not wanted:
        raise RepairError(f"{folder} does not say by its checksum which scenario it was made from")
    if hashlib.sha256(path.read_bytes()).hexdigest() != wanted:
        raise RepairError(f"the scenario {path} is not the one the result was made from (checksum)")
    return path


def _read(file: Path) -> Any:
    """Strict JSON from a file; without NaN and infinity."""

    def constant(word: str) -> float:
        raise ValueError(f"{word} is no JSON")

    try:
        return json.loads(file.read_text(encoding="utf-8"), parse_constant=constant)
    except (OSError, ValueError, RecursionError) as error:  # also what is no UTF-8, and no JSON
        raise RepairError(f"{file} cannot be read: {in_words(error)}") from error


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
    folder = path_of(folder, "the folder of a result", RepairError)
    record = read_record(folder)
    name = record.get("drawing_file")
    if name is None:
        return Outcome(record)
    file = folder / str(name)
    if not file.is_file():
        raise RepairError(f"the drawing {file} of the result is not there any more")
    try:
        drawing = drawing_from(_read(file))
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise RepairError(f"{file} is damaged: {type(error).__name__} {in_words(error)}") from error
    return Outcome(record, drawing)
