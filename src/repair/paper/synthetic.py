"""The paper's two scenarios, generated as CommonRoad scenarios.

Both are reconstructions: roads are straights, clothoids and arcs, cars follow them with piecewise
constant acceleration. Neither file of the paper is contained here, no coordinate list is copied.

Source of the scenarios: Sec. V-B and V-C of the paper on safety-metric-aware trajectory repairing.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from repair.errors import ConfigError, OutputError
from repair.paper.roads import DATE
from repair.paper.scenario_1 import scenario_1, scenario_1_stops
from repair.paper.scenario_2 import scenario_2

__all__ = ["SCENARIOS", "write_scenario"]


SCENARIOS: Mapping[str, Callable[[], tuple[Any, Any]]] = MappingProxyType(
    {"scenario_1": scenario_1, "scenario_2": scenario_2, "scenario_1_stops": scenario_1_stops}
)
"""Name to generator."""


def write_scenario(name: str, folder: str | Path) -> Path:
    """Write a generated scenario as CommonRoad 2020a XML, named after its benchmark id.

    The same scenario gives the same bytes. The file is written aside and renamed.

    Raises
    ------
    ConfigError
        If there is no scenario of that name.
    OutputError
        If the file cannot be written.
    """
    from repair.scene.reading import require_commonroad

    require_commonroad()
    from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile

    if name not in SCENARIOS:
        raise ConfigError(f"there is no generated scenario {name!r}; there is {', '.join(SCENARIOS)}")
    scenario, problems = SCENARIOS[name]()
    target = Path(folder) / f"{scenario.scenario_id}.xml"
    writer = CommonRoadFileWriter(scenario, problems, decimal_precision=4)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=".writing-") as aside:
            draft = Path(aside) / target.name
            writer.write_to_file(str(draft), OverwriteExistingFile.ALWAYS)
            content = re.sub(rb' date="[^"]*"', f' date="{DATE}"'.encode(), draft.read_bytes(), count=1)
            draft.write_bytes(content)
            os.replace(draft, target)
    except OSError as error:
        raise OutputError(f"{target} cannot be written: {error.strerror or error}") from error
    return target
