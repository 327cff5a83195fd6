"""The paper's two scenarios as scenes, and where they come from."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.errors import ConfigError

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["origin_of", "origin_text", "paper_scenes"]


def paper_scenes(scenario_dir: Path | str | None, numbers: Sequence[int]) -> dict[int, Scene]:
    """The scenes of the paper's scenarios, read as their presets say.

    Parameters
    ----------
    scenario_dir : path, optional
        Folder that may hold the official file of Scenario 1; the folder COMMONROAD_SCENARIOS is asked
        next, and what is in neither is generated.
    numbers : sequence of int

    Raises
    ------
    ConfigError
        If the folder does not exist.
    """
    from repair.config import load_config
    from repair.paper.bundled import OFFICIAL_FILES, paper_scenario
    from repair.scene.commonroad import load_scene

    if scenario_dir is not None and not Path(scenario_dir).is_dir():
        raise ConfigError(f"the scenario folder {scenario_dir} does not exist")
    scenes = {}
    for number in numbers:
        name = f"scenario_{number}"
        config = load_config(preset=name)
        given = Path(scenario_dir or ".", OFFICIAL_FILES.get(name, ""))
        known = scenario_dir is not None and given.is_file()
        with nullcontext(given) if known else paper_scenario(name) as path:
            scenes[number] = load_scene(path, config)
    return scenes


def origin_of(scene: Scene) -> dict[str, Any]:
    """Kind (official, reconstruction, file), name, benchmark id and checksum."""
    from repair.scene.provenance import provenance

    origin = provenance(scene)
    return {key: origin[key] for key in ("kind", "name", "benchmark_id", "sha256")}


def origin_text(origin: dict[str, Any]) -> str:
    """The same in words."""
    sha = (origin["sha256"] or "")[:12]
    if origin["kind"] == "reconstruction":
        return f"reconstruction from the paper's text, sha256 {sha}…"
    name = "official file" if origin["kind"] == "official" else "file"
    return f"{name} {origin['name']}, sha256 {sha}…"
