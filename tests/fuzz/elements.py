"""Mutations that suit any XML file, and what all XML mutations need."""

from __future__ import annotations

import copy
import random
from xml.etree import ElementTree as ET

Element = ET.Element

NUMBERS = (
    "nan", "inf", "-inf", "1e308", "-1e308", "1e999", "1e-320", "-5", "0", "-0", str(10**30), str(-(10**30)),
    "2147483648", "1e9", "-1e9", "1e5", "1e-9", "1_0", "3.7", "-1", "1", "17", "１２", "9" * 400,
)  # fmt: skip
# Numbers three times as often as what is none: the latter mostly ends in commonroad-io already.
ODD_NUMBERS = (*NUMBERS * 3, "", " ", "abc", "1,5", "0x10", "7 8", "None", "true")
ODD_NAMES = (
    "", "../../x", "a/b", "äö-1", "x" * 3000, "DEU_X-1_1_T-1", "C-", "-1_1", "_", "ZAM", "DEU_A-b_c_T-d",
)  # fmt: skip


def parents_of(root: Element) -> dict[Element, Element]:
    return {child: parent for parent in root.iter() for child in parent}


def any_of(rng: random.Random, root: Element, *tags: str) -> Element | None:
    found = [e for e in root.iter() if e.tag in tags]
    return rng.choice(found) if found else None


def is_number(text: str | None) -> bool:
    try:
        float(text or "")
    except ValueError:
        return False
    return True


def number_leaves(root: Element) -> list[Element]:
    return [e for e in root.iter() if not len(e) and is_number(e.text)]


def make_leaf(tag: str, text: str) -> Element:
    made = Element(tag)
    made.text = text
    return made


def make_point(x: float, y: float, tag: str = "point") -> Element:
    made = Element(tag)
    made.extend([make_leaf("x", repr(x)), make_leaf("y", repr(y))])
    return made


def delete_element(rng: random.Random, root: Element) -> None:
    parents = parents_of(root)
    # First a tag, then one of its elements: or nearly all would be points of lanelets.
    tag = rng.choice(sorted({e.tag for e in parents}))
    for victim in rng.sample([e for e in parents if e.tag == tag], 1):
        parents[victim].remove(victim)


def delete_all_of_a_kind(rng: random.Random, root: Element) -> None:
    tag = rng.choice(sorted({e.tag for e in root.iter()} - {root.tag}))
    for child, parent in parents_of(root).items():
        if child.tag == tag and child in parent:
            parent.remove(child)


def duplicate_element(rng: random.Random, root: Element) -> None:
    parents = parents_of(root)
    tag = rng.choice(sorted({e.tag for e in parents}))
    twin = rng.choice([e for e in parents if e.tag == tag])
    parents[twin].insert(list(parents[twin]).index(twin), copy.deepcopy(twin))


def move_element(rng: random.Random, root: Element) -> None:
    parents = parents_of(root)
    tag = rng.choice(sorted({e.tag for e in parents}))
    moved = rng.choice([e for e in parents if e.tag == tag])
    inside = set(moved.iter())
    places = [e for e in root.iter() if e not in inside and len(e)]
    parents[moved].remove(moved)
    place = rng.choice(places or [root])
    place.insert(rng.randrange(len(place) + 1), moved)


def shuffle_children(rng: random.Random, root: Element) -> None:
    element = rng.choice([e for e in root.iter() if len(e) > 1])
    children = list(element)
    rng.shuffle(children)
    element[:] = children


def rename_tag(rng: random.Random, root: Element) -> None:
    tag = rng.choice(sorted({e.tag for e in root.iter()}))
    new = rng.choice(["x", tag.upper(), tag[:-1] or "y", "point", "exact", "commonRoad", "planningProblem"])
    chosen = [e for e in root.iter() if e.tag == tag]
    for element in chosen if rng.random() < 0.3 else rng.sample(chosen, 1):
        element.tag = new


def odd_number(rng: random.Random, root: Element) -> None:
    parents, numbers = parents_of(root), number_leaves(root)
    group = rng.choice(sorted({parents[e].tag for e in numbers if e in parents}))
    chosen = [e for e in numbers if e in parents and parents[e].tag == group]
    # The new text is drawn before the element.
    text = rng.choice(ODD_NUMBERS)
    rng.choice(chosen).text = text


def many_odd_numbers(rng: random.Random, root: Element) -> None:
    numbers = number_leaves(root)
    for element in rng.sample(numbers, min(len(numbers), rng.choice([3, 10, 100]))):
        element.text = rng.choice(ODD_NUMBERS)


def scale_number(rng: random.Random, root: Element) -> None:
    element = rng.choice(number_leaves(root))
    element.text = repr(float(element.text or 0.0) * rng.choice([-1.0, 0.0, 1e-6, 10.0, 1e3, 1e6]))


def odd_attribute(rng: random.Random, root: Element) -> None:
    name = rng.choice(sorted({a for e in root.iter() for a in e.attrib}))
    element = rng.choice([e for e in root.iter() if name in e.attrib])
    if rng.random() < 0.4:
        del element.attrib[name]
    else:
        element.attrib[name] = rng.choice((*ODD_NUMBERS, *ODD_NAMES))


def deep_nesting(rng: random.Random, root: Element) -> None:
    element = rng.choice(list(root.iter()))
    for _ in range(rng.choice([50, 500])):
        inner = Element(element.tag)
        element.append(inner)
        element = inner


def text_in_place_of_children(rng: random.Random, root: Element) -> None:
    tag = rng.choice(sorted({e.tag for e in root.iter() if len(e) and e is not root}))
    element = rng.choice([e for e in root.iter() if e.tag == tag and len(e)])
    element[:] = []
    element.text = rng.choice(["", "7", "text"])


def jitter(rng: random.Random, root: Element) -> None:
    """Noise on many numbers: bounds that cross, bodies that jump."""
    noise, share = rng.choice([0.001, 0.02, 0.3]), rng.choice([0.02, 0.3, 1.0])
    for leaf in number_leaves(root):
        if leaf.text and not leaf.text.isdigit() and rng.random() < share:
            leaf.text = repr(float(leaf.text) * (1.0 + rng.gauss(0.0, noise)))


def scale_world(rng: random.Random, root: Element) -> None:
    """Roads of a millimetre's or a hundred kilometres' length; a mirrored one, left and right swapped."""
    x, y = rng.choice(
        [(1e-3, 1e-3), (0.1, 0.1), (10.0, 10.0), (1e3, 1e3), (1.0, -1.0), (1.0, 0.0), (0.1, 10.0)]
    )
    for leaf in root.iter():
        if leaf.tag in ("x", "y") and is_number(leaf.text):
            leaf.text = repr(float(leaf.text or 0) * (x if leaf.tag == "x" else y))


def translate(rng: random.Random, root: Element) -> None:
    """The whole scenario somewhere else, as in UTM coordinates: nothing may depend on where."""
    shift = rng.choice([1e3, 5e5, 5e6, -1e8])
    for leaf in root.iter():
        if leaf.tag in ("x", "y") and is_number(leaf.text):
            leaf.text = repr(float(leaf.text or 0) + shift)


GENERIC = (
    delete_element, delete_all_of_a_kind, duplicate_element, move_element, shuffle_children, rename_tag,
    odd_number, many_odd_numbers, scale_number, odd_attribute, deep_nesting, text_in_place_of_children,
    jitter,
    scale_world,
    translate,
)  # fmt: skip
