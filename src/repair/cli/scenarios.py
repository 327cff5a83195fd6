"""``repair scenarios``: what files hold, before anything is repaired."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from repair.cli.arguments import UsageError, configuration_arguments, resolve
from repair.errors import RepairError

if TYPE_CHECKING:
    from repair.config import Config


def scenarios_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair scenarios``."""
    parser.add_argument(
        "paths", nargs="+", type=Path, metavar="FILE", help="CommonRoad files, or folders of them"
    )
    configuration_arguments(parser)


def scenarios(arguments: argparse.Namespace) -> int:
    """A block for each file; one that cannot be used is a line, and an error where it is the only one."""
    config = resolve(arguments)
    files = [file for path in arguments.paths for file in _files(path)]
    for number, file in enumerate(files):
        if number:
            print()
        try:
            print("\n".join(_lines(file, config)))
        except RepairError as error:
            if len(files) == 1:
                raise
            print(f"File      {file.name}\nError     {' '.join(str(error).split())}")
    return 0


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    found = sorted(path.glob("*.xml"))
    if not found:
        raise UsageError(f"{path} holds no XML file")
    return found


def _lines(file: Path, config: Config) -> list[str]:
    """What there is to say of one file."""
    import numpy as np

    from repair.report.notes import grouped
    from repair.scene.commonroad import load_scene
    from repair.scene.road.direction import driven_lanes
    from repair.scene.road.joints import joints_of
    from repair.world.road import RoadBoundary

    scene = load_scene(file, config)
    ego = scene.initial_state
    lanes, _ = driven_lanes(scene.scenario.lanelet_network, np.array([ego.x, ego.y]), ego.orientation)
    bridged = joints_of(
        ((lane.id, name) for lane in lanes.values() for name in lane.successors if name in lanes), lanes
    )
    gap = config.checker.road_gap
    bridged += RoadBoundary(scene.scenario, scene.vehicle, gap).bridged()
    roles = [obstacle.role for obstacle in scene.obstacles]
    counted = ", ".join(f"{roles.count(role)} {role}" for role in dict.fromkeys(roles)) or "none"
    ahead = scene.route_end_s - float(scene.start[0, 0])
    lines = [
        f"File      {file.name} ({scene.id})",
        f"Ego       planning problem {scene.planning_problem_id}, from ({ego.x:.1f}, {ego.y:.1f}) "
        f"at {ego.velocity:.1f} m/s",
        f"Horizon   {scene.horizon:g} s in steps of {scene.dt:g} s",
        f"Obstacles {counted}",
        f"Route     {' '.join(map(str, scene.route_lanelets))}; {ahead:.0f} m ahead",
        f"Map       {len(lanes)} lanelets; gaps and holes up to {gap:g} m count as road",
    ]
    for title, texts in (
        ("Bridged", [str(one) for one in bridged] or ["nothing"]),
        ("Note", grouped(scene.notes)),
    ):
        lines += [f"{title if not k else '':<10}{text}" for k, text in enumerate(texts)]
    return lines
