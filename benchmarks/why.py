"""Is what an explanation states so? Every sufficient amount, asked and judged again by other means.

    python -m benchmarks.why FOLDER [--backend ego ...] [--reference constant ...] [--later] [--alone]

For each search that finds nothing (with ``--later`` also for the first infeasible time-to-repair after the
F-TTR) each relaxation that is called sufficient is made anew from the file: with it the backends that were
asked have a repair, of which shapes, road and accelerations are looked at by shapely and by differences; with
half of it they have none. ``--alone`` leaves out the fallbacks of the search.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from repair.api import find, make
from repair.config import load_config
from repair.curves.base import SplicedCurve
from repair.errors import RepairError
from repair.preparation import Prepared, prepare
from repair.scene.commonroad import load_scene
from repair.search.result import SearchStatus
from repair.search.settings import EXPLAINED
from repair.solvers.registry import make_backend
from repair.why.explain import Explanation, explain
from repair.why.kinds import under

SLACK = 1.02  # of accelerations from differences of the speed


def laid(file: Path, reference: str, backend: str, keys: list[str]) -> Prepared:
    """A situation from its file."""
    config = load_config(backend=backend, overrides=[f"reference.source={reference}", *keys])
    return prepare(load_scene(file, config), config)


def faults(situation: Prepared, curve: Any, t_rep: float) -> list[str]:
    """What is wrong with a repair, looked at without the checker."""
    driven = curve if curve is situation.reference else SplicedCurve(situation.reference, curve, t_rep)
    states, checker = situation.checker.drive(driven, situation.t_end), situation.checker
    n = checker.config.substeps
    half = situation.scene.vehicle.half_length, situation.scene.vehicle.half_width
    bodies = bodies_of(np.column_stack((states.x, states.y, states.orientation)), *half)[::n]
    wrong = []
    for one in situation.scene.obstacles:
        for k, body in enumerate(bodies):
            if k <= one.n_steps and shapely.intersects(body, shape_at(one, k)):
                wrong.append(f"meets {one.id} at step {k}")
                break
    if checker.road is not None:
        region = checker.road.region
        if not shapely.covers(region, bodies).all():
            wrong.append("leaves the road")
    if checker.config.limits:
        first = max(round(t_rep / situation.scene.dt), 0)
        speed = states.speed[::n][first:]
        along = np.diff(speed) / situation.scene.dt
        if len(along) and along.min() < SLACK * situation.limits.a_min - 0.1:
            wrong.append(f"brakes at {along.min():.2f} m/s²")
    return wrong


def bodies_of(poses: np.ndarray, half_length: float, half_width: float) -> Any:
    """Rectangles at poses ``x, y, heading`` (K, 3)."""
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (half_length, half_width)
    cos, sin = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    x = poses[:, :1] + cos * corners[:, 0] - sin * corners[:, 1]
    y = poses[:, 1:2] + sin * corners[:, 0] + cos * corners[:, 1]
    return shapely.polygons(np.stack((x, y), axis=2))


def shape_at(one: Any, k: int) -> Any:
    """What an obstacle occupies at a step; nothing where it is absent."""
    if one.rectangles is not None:
        row = one.rectangles[k]
        return shapely.Polygon() if np.isnan(row).any() else bodies_of(row[None, :3], *row[3:])[0]
    if one.circles is not None:
        row = one.circles[k]
        return shapely.Polygon() if np.isnan(row).any() else shapely.Point(row[:2]).buffer(row[2])
    return shapely.union_all([shapely.Polygon(part) for part in one.polygons[k]])


def again(situation: Prepared, names: tuple[str, ...], t_rep: float) -> tuple[bool, list[str]]:
    """Whether one of the backends has a repair, and what is wrong with it."""
    if situation.conflict.time > situation.t_end - 1e-9:
        return True, faults(situation, situation.reference, t_rep)
    if situation.conflict.time <= t_rep - 1e-9:
        return False, []
    for name in names:
        found = find(situation, make_backend(name, situation.config), visits=(t_rep,))
        if found.status is SearchStatus.FOUND:
            return True, faults(situation, found.curve, t_rep)
    return False, []


def wrongs(fresh: Prepared, why: Explanation) -> list[str]:
    """Statements that do not hold."""
    wrong = []
    for one in why.relaxations:
        if not one.sufficient:
            continue
        words = f"{one.kind} {one.amount or ''} {one.obstacle_id or ''}"
        there, why_not = again(under(fresh, one.kind, one.amount or 0.0, one.index), why.asked, why.t_rep)
        if not there:
            wrong.append(f"{words}: no repair")
        wrong += [f"{words}: {text}" for text in why_not]
        half = fresh if not one.half else under(fresh, one.kind, one.half, one.index)
        if again(half, why.asked, why.t_rep)[0]:
            wrong.append(f"{words}: half of it suffices")
    return wrong


def row(name: str, reference: str, backend: str, why: Explanation, wrong: list[str]) -> str:
    """One line of the table."""
    kinds = {kind: [one for one in why.relaxations if one.kind == kind] for kind in EXPLAINED}
    cells = [name, reference, backend, f"{why.t_rep:.1f}", why.exists_by or ("proven" if why.proven else "–")]
    blocks = why.blocking
    cells.append("?" if blocks is None else ", ".join(str(one.id) for one in blocks.obstacles) or "none")
    for some in kinds.values():
        best = [one for one in some if one.sufficient]
        amount = min((one.amount or 0.0 for one in best), default=None)
        none = "" if not some or some[0].status == "impossible" else "no"
        cells.append(none if amount is None else "yes" if some[0].kind == "removed" else f"{amount:g}")
    cells += [f"{why.seconds:.1f}", "; ".join(wrong) or "holds"]
    return f"| {' | '.join(cells)} |"


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--backend", nargs="+", default=["ego", "casadi", "qptr"])
    parser.add_argument("--reference", nargs="+", default=["constant", "accelerate"])
    parser.add_argument(
        "--later", action="store_true", help="also the first infeasible t_rep after the F-TTR"
    )
    parser.add_argument("--alone", action="store_true", help="no fallbacks of the search")
    parser.add_argument("--part", default="0/1", help="K/N: every N-th file from the K-th on")
    parser.add_argument("--set", nargs="+", default=[], help="further keys")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    keys = [*asked.set, *(["fallback=[]"] if asked.alone else [])]
    first, every = map(int, asked.part.split("/"))
    head = [
        "file",
        "reference",
        "backend",
        "t_rep [s]",
        "exists",
        "in the way",
        *EXPLAINED,
        "CPU [s]",
        "shown",
    ]
    print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}")
    count, seconds, begin = Counter[str](), [], time.perf_counter()
    for file in sorted(asked.folder.glob("*.xml"))[first::every]:
        for reference in asked.reference:
            for backend in asked.backend:
                try:
                    prepared = laid(file, reference, backend, keys)
                    found = find(prepared, make(prepared.config))
                    count[found.status.value] += 1
                    if found.status is not SearchStatus.NONE_FEASIBLE and not asked.later:
                        continue
                    why = explain(prepared, found)
                    if why is None:
                        continue
                    wrong = wrongs(laid(file, reference, backend, keys), why)
                except RepairError as error:
                    print(f"{file.name} {reference} {backend}: {error}", file=sys.stderr)
                    continue
                good = [one for one in why.relaxations if one.sufficient]
                count["explained"] += 1
                count["with a relaxation that suffices"] += bool(good)
                count["relaxations that suffice"] += len(good)
                count["relaxations that do not"] += sum(
                    one.status == "not_sufficient" for one in why.relaxations
                )
                count["statements that do not hold"] += len(wrong)
                count["cut"] += not why.complete
                seconds.append(why.seconds)
                print(row(file.stem, reference, backend, why, wrong), flush=True)
    print("\n" + ", ".join(f"{name}: {n}" for name, n in count.items()))
    if seconds:
        told = np.quantile(seconds, (0.5, 0.9, 1.0))
        print(
            f"processor time of an explanation: median {told[0]:.1f}, 90 % {told[1]:.1f}, all {told[2]:.1f} s"
        )
    print(f"{time.perf_counter() - begin:.0f} s")
    return int(count["statements that do not hold"] > 0)


if __name__ == "__main__":
    sys.exit(main())
