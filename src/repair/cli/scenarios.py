"""``repair scenarios``: what files hold, before anything is repaired."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from repair.cli.arguments import UsageError, configuration_arguments, resolve
from repair.errors import RepairError

if TYPE_CHECKING:
    from repair.config import Config
    from repair.scene.road.joints import Bridge
    from repair.scene.scene import Scene

_NAMED = 3  # faults of one kind that are all named


def scenarios_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair scenarios``."""
    parser.add_argument(
        "paths", nargs="+", type=Path, metavar="FILE", help="CommonRoad files, or folders of them"
    )
    parser.add_argument(
        "--all", action="store_true", dest="every", help="name each fault of the map, however many there are"
    )
    configuration_arguments(parser)


def scenarios(arguments: argparse.Namespace) -> int:
    """A block for each file, and a line about all; one that cannot be used is an error if it is alone."""
    from tqdm import tqdm

    config = resolve(arguments)
    files = [file for path in arguments.paths for file in _files(path)]
    alone, kinds = len(files) == 1, Counter[str]()
    for file in tqdm(files, disable=alone or None, desc="scenarios"):
        try:
            kind, lines = _lines(file, config, arguments.every)
        except RepairError as error:
            if alone:
                raise
            kind, lines = (
                "not usable",
                [f"File      {file.name}", f"Error     {' '.join(str(error).split())}"],
            )
        kinds[kind] += 1
        tqdm.write("\n".join([*lines, *([] if alone else [""])]), file=sys.stdout)
    if not alone:
        counted = ", ".join(f"{number} {kind}" for kind, number in kinds.most_common())
        print(f"{len(files)} files, conflict on the reference {config.reference.source}: {counted}")
    return 0


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    found = sorted(path.glob("*.xml"))
    if not found:
        raise UsageError(f"{path} holds no XML file")
    return found


def _conflict(scene: Scene, config: Config) -> tuple[str, str]:
    """The kind of the reference's conflict, and that in words; a reference that is none is one, too."""
    from repair.preparation import prepare

    try:
        prepared = prepare(scene, config)
    except RepairError as error:
        return "no reference", f"not known: {' '.join(str(error).split())}"
    found, source = prepared.conflict, f"on the reference {config.reference.source}"
    if found.kind == "none":
        return "none", f"none {source}, until {prepared.t_reference:.4g} s"
    who = "" if found.obstacle_id is None else f" of obstacle {found.obstacle_id}"
    kind = found.kind.replace("_", " ")
    return kind, f"{kind}{who} at {found.time:.2f} s {source}"


def _faults(bridged: Sequence[Bridge], every: bool) -> list[str]:
    """The faults of the map that were bridged, the largest of each kind where there are many."""
    kinds: dict[str, list[Bridge]] = {}
    for one in bridged:
        kinds.setdefault(one.kind, []).append(one)
    lines = []
    for same in kinds.values():
        if every or len(same) <= _NAMED:
            lines += [str(one) for one in same]
        else:
            largest = max(same, key=lambda one: one.size)
            lines.append(f"{largest} (the largest of {len(same)} of this kind; --all names each)")
    return lines or ["nothing"]


def _lines(file: Path, config: Config, every: bool = False) -> tuple[str, list[str]]:
    """What there is to say of one file, and the kind of its conflict."""
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
    kind, conflict = _conflict(scene, config)
    lines = [
        f"File      {file.name} ({scene.id})",
        f"Ego       planning problem {scene.planning_problem_id}, from ({ego.x:.1f}, {ego.y:.1f}) "
        f"at {ego.velocity:.1f} m/s",
        f"Horizon   {scene.horizon:g} s in steps of {scene.dt:g} s",
        f"Obstacles {counted}",
        f"Conflict  {conflict}",
        f"Route     {' '.join(map(str, scene.route_lanelets))}; {ahead:.0f} m ahead",
        f"Map       {len(lanes)} lanelets; gaps and holes up to {gap:g} m count as road",
    ]
    for title, texts in (
        ("Bridged", _faults(bridged, every)),
        ("Note", grouped(scene.notes)),
    ):
        lines += [f"{title if not k else '':<10}{text}" for k, text in enumerate(texts)]
    return kind, lines
