"""The paper's two scenarios as scenes, and where they come from."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.errors import ConfigError

if TYPE_CHECKING:
    from repair.scene.commonroad import Scene

__all__ = ["origin_of", "origin_text", "paper_scenes"]

_OFFICIAL_FILE = "DEU_Flensburg-6_1_T-1.xml"


def paper_scenes(scenario_dir: Path | str | None, numbers: Sequence[int]) -> dict[int, Scene]:
    """The scenes of the paper's scenarios, read as their presets say.

    Parameters
    ----------
    scenario_dir : path, optional
        Folder that may hold the official file of Scenario 1; whatever is not there is generated.
    numbers : sequence of int

    Raises
    ------
    ConfigError
        If the folder does not exist.
    """
    from repair.config import load_config
    from repair.scene.commonroad import load_scene
    from repair.scene.synthetic import write_scenario

    folder = None if scenario_dir is None else Path(scenario_dir)
    if folder is not None and not folder.is_dir():
        raise ConfigError(f"the scenario folder {folder} does not exist")
    scenes = {}
    with tempfile.TemporaryDirectory(prefix="repair-") as aside:
        for number in numbers:
            path = folder / _OFFICIAL_FILE if folder is not None else None
            if number != 1 or path is None or not path.is_file():
                path = write_scenario(f"scenario_{number}", Path(aside))
            config = load_config(preset=f"scenario_{number}").scene
            scenes[number] = load_scene(
                path,
                planning_problem=config.planning_problem,
                vehicle=config.vehicle,
                horizon=config.horizon,
                after_prediction=config.after_prediction,
            )
    return scenes


def origin_of(scene: Scene) -> dict[str, Any]:
    """Kind (official, reconstruction, file), name, benchmark id and checksum."""
    from repair.export import provenance

    origin = provenance(scene)
    return {key: origin[key] for key in ("kind", "name", "benchmark_id", "sha256")}


def origin_text(origin: dict[str, Any]) -> str:
    """The same in words."""
    sha = (origin["sha256"] or "")[:12]
    if origin["kind"] == "reconstruction":
        return f"reconstruction from the paper's text, sha256 {sha}…"
    name = "official file" if origin["kind"] == "official" else "file"
    return f"{name} {origin['name']}, sha256 {sha}…"
