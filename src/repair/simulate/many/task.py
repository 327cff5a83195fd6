"""One drive as a row of a study; what drives of a file have in common is made once."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

from repair.errors import RepairError
from repair.io.drawing_json import drawing_to_dict
from repair.scene.commonroad import load_scene
from repair.scene.scene import Scene
from repair.simulate.many.case import Case, Plan, case_at, plan_on
from repair.simulate.many.picture import drawing_of_drive
from repair.simulate.measures import row_of
from repair.study.plan import Task
from repair.study.task import Kept, guarded, packed
from repair.study.worker import Answer, run_task

__all__ = ["drive_of", "run_drive"]


@dataclass
class _Ready:
    """What the last drive was made of, kept for the next one: a scene, its plans, a case."""

    file: tuple[str, str] | None = None
    scene: Scene | None = None
    plans: dict[str, Plan | RepairError] = field(default_factory=dict)
    case: tuple[str, float, Case | str] | None = None

    def turn_to(self, task: Task) -> None:
        """Forget another scenario."""
        if self.file != (task.path, task.sha256):
            self.file, self.scene, self.case = (task.path, task.sha256), None, None
            self.plans.clear()

    def plan(self, task: Task) -> Plan:
        """The plan; where there is none, the reason is kept, too."""
        if task.reference not in self.plans:
            try:
                if self.scene is None:
                    self.scene = load_scene(task.path, task.config.scene)
                self.plans[task.reference] = plan_on(self.scene, task.config)
            except RepairError as error:
                self.plans[task.reference] = error
        made = self.plans[task.reference]
        if isinstance(made, RepairError):
            raise made
        return made

    def at(self, task: Task) -> Case | str:
        """The case of a task, or why there is none."""
        plan, shift = self.plan(task), float(task.varied["shift_s"])
        if self.case is None or self.case[:2] != (task.reference, shift):
            self.case = task.reference, shift, case_at(plan, task.config, shift)
        return self.case[2]


_ready = _Ready()


def drive_of(task: Task, _: Kept | None = None) -> Answer:
    """The row of a drive, whatever happens, and the drive itself with what is around it, compressed."""
    return guarded(task, lambda: _driven(task))


def _driven(task: Task) -> Answer:
    _ready.turn_to(task)
    row: dict[str, Any] = {"file": task.file, "backend": task.backend, "reference": task.reference}
    case = _ready.at(task)
    if isinstance(case, str):
        return {**row, "status": "not_driven", "detail": case}, None
    prediction, policy = task.varied["prediction"], task.varied["policy"]
    driven = case.never if policy == "never" else case.drive(prediction, policy)
    measured = row_of(driven, case.never, case.config.checker.clearance, case.grounds(prediction).period)
    drawing = drawing_to_dict(drawing_of_drive(case, driven))
    return {**row, "status": "driven", "detail": "", **measured}, packed(driven.plain(), drawing)


#: In a process of its own.
run_drive = partial(run_task, make=drive_of)
