"""Mutations of CommonRoad scenario and solution files by name; the same seed gives the same file."""

from __future__ import annotations

import random
from collections.abc import Callable
from xml.etree import ElementTree as ET

from tests.fuzz.elements import GENERIC
from tests.fuzz.raw import RAW
from tests.fuzz.scenario import SCENARIO

__all__ = ["BYTE_MUTATIONS", "XML_MUTATIONS", "damage_bytes", "damage_xml"]

XML_MUTATIONS: dict[str, Callable[[random.Random, ET.Element], None]] = {
    f.__name__: f for f in (*GENERIC, *SCENARIO)
}
BYTE_MUTATIONS: dict[str, Callable[[random.Random, bytes], bytes]] = {f.__name__: f for f in RAW}
_GENERIC = tuple(f.__name__ for f in GENERIC)


def damage_xml(
    rng: random.Random, data: bytes, name: str | None = None, *, stack: bool = True
) -> tuple[bytes, str]:
    """One to three XML mutations; ``name`` fixes the first. Returns the file and what was done to it.

    Parameters
    ----------
    rng : random.Random
    data : bytes
        A well-formed XML file.
    name : str, optional
        Key of :data:`XML_MUTATIONS`; ``generic`` for one that suits any XML file.
    stack : bool
        Whether others may follow.
    """
    root = ET.fromstring(data)
    first = rng.choice(_GENERIC) if name == "generic" else name or rng.choice(sorted(XML_MUTATIONS))
    pool = _GENERIC if name == "generic" else sorted(XML_MUTATIONS)
    names = [first] + [rng.choice(pool) for _ in range(rng.choice([0, 0, 1, 2]) * stack)]
    done = []
    for each in names:
        try:
            XML_MUTATIONS[each](rng, root)
            done.append(each)
        except IndexError:  # nothing is left that this one could damage
            pass
    return ET.tostring(root, encoding="utf-8", xml_declaration=True), "+".join(done) or "unchanged"


def damage_bytes(rng: random.Random, data: bytes, name: str) -> tuple[bytes, str]:
    """One byte-level mutation, by name."""
    return BYTE_MUTATIONS[name](rng, data), name
