"""A stored drive as a film, and the page of a stored simulation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from repair.errors import RepairError
from repair.io.drawing_json import drawing_from
from repair.report.film.drive import film_of_drive
from repair.report.film.frames import Film
from repair.report.loop.page import simulation_page
from repair.simulate.many.run import drives_in
from repair.simulate.measures import SIMULATION
from repair.study.store import Store
from repair.study.task import unpacked

__all__ = ["film_in", "page_of_simulation"]


def film_in(folder: Path, wanted: Mapping[str, Any]) -> tuple[Film, str]:
    """The film of a drive, and which one it is, in words.

    Of several drives that fit it is the first one in which the ego leaves its plan, else the first one.

    Parameters
    ----------
    folder : Path
        Of a simulation.
    wanted : mapping
        Columns of its rows with the value wanted; None: any.

    Raises
    ------
    RepairError
        If no drive fits, or what is stored of it cannot be drawn.
    """
    wanted = {name: value for name, value in wanted.items() if value is not None}
    with Store(folder, SIMULATION, readonly=True) as store:
        positions = [task["position"] for task in store.tasks() if task["done"]]
        fits = [
            (position, row)
            for position, row in zip(positions, store.rows(), strict=True)
            if row["status"] == "driven" and all(row[name] == value for name, value in wanted.items())
        ]
        if not fits:
            words = ", ".join(f"{name} {value}" for name, value in wanted.items())
            raise RepairError(f"{store.path} holds no drive{f' with {words}' if words else ''}")
        position, row = next((one for one in fits if one[1]["interventions"]), fits[0])
        whole = store.whole(position)
    try:
        content = unpacked(whole or b"")
        film = film_of_drive({**row, "drive": content["record"]}, drawing_from(content["drawing"]))
    except (ValueError, KeyError, TypeError, AttributeError, ArithmeticError, EOFError) as error:
        raise RepairError(f"{folder}: the drive that is stored cannot be drawn ({error})") from error
    named = f"{row['file']}, plan {row['reference']}, traffic {row['shift_s']:g} s later, {row['prediction']}"
    return film, f"{named}, {row['policy']}: one of {len(fits)} that fit"


def page_of_simulation(folder: Path) -> str:
    """The page of the simulation in a folder.

    Raises
    ------
    RepairError
        If there is no drive yet.
    """
    with Store(folder, SIMULATION, readonly=True) as store:
        drives = list(drives_in(store))
        if not drives:
            raise RepairError(f"{store.path} holds no drive of its simulation yet")
    return simulation_page(drives)
