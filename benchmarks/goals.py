"""Which goals can be reached at all, and which are: ``python -m benchmarks.goals FOLDER [SWEEP.json]``.

A goal counts as reachable if the ego gets there, within its limits and on the road, with nobody else
about: by the same legs that ``repair.goal`` tries, leaving the reference at any time before that fails.
``SWEEP.json`` is what ``repair sweep FOLDER --set repair.goal=true --out OUT`` wrote: of its rows it is
then said how many with a reachable goal pass all of CommonRoad's ``valid_solution``, and what is missed
by the others.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path


def reachable(file: Path, reference: str) -> str:
    """``reached``, or what is missed with nobody else about."""
    import repair
    from repair.config import load_config
    from repair.errors import RepairError
    from repair.onward.plan import to_the_goal
    from repair.outcome.onward_record import onward_to_dict
    from repair.preparation import prepare

    config = load_config(overrides=[f"reference.source={reference}"])
    try:
        scene = repair.load_scene(file, config)
        alone = replace(scene, obstacles=(), recorded_ego=None, scenario=_without(scene.scenario))
        prepared = prepare(alone, config)
    except RepairError as error:
        return str(error)
    until = max(min(prepared.t_reference, prepared.conflict.time - alone.dt), 0.0)
    found = onward_to_dict(to_the_goal(prepared.ends, prepared.reference, 0.0, until))
    return "reached" if found["reached"] else str(found["sentence"])


def _without(scenario):
    """The scenario with its road alone."""
    from copy import deepcopy

    copied = deepcopy(scenario)
    copied.remove_obstacle([*copied.static_obstacles, *copied.dynamic_obstacles])
    return copied


def main(arguments: list[str]) -> int:
    """Print what there is."""
    warnings.simplefilter("ignore")
    folder = Path(arguments[0])
    rows = json.loads(Path(arguments[1]).read_text(encoding="utf-8"))["rows"] if len(arguments) > 1 else []
    references = list(dict.fromkeys(row["reference"] for row in rows)) or ["planner"]
    for reference in references:
        can = {file.name: reachable(file, reference) for file in sorted(folder.glob("*.xml"))}
        far = [name for name, word in can.items() if word != "reached"]
        print(f"{reference}: {len(can) - len(far)} of {len(can)} goals can be reached with nobody else about")
        for name in far:
            print(f"  not: {name}: {can[name]}")
        for backend in dict.fromkeys(row["backend"] for row in rows):
            own = [
                row
                for row in rows
                if (row["reference"], row["backend"]) == (reference, backend)
                and row["official_valid"] is not None
                and can[row["file"]] == "reached"
            ]
            valid = sum(bool(row["official_valid"]) for row in own)
            print(f"{reference}, {backend}: {valid} of {len(own)} with a reachable goal are valid as a whole")
            for row in own:
                if not row["official_valid"]:
                    print(f"  not: {row['file']}: {row['onward_detail']}")
    print(dict(Counter(row["status"] for row in rows)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
