"""The certificate of a bound: it passes as it is written, and not as anybody else would have it."""

from __future__ import annotations

import copy
import gzip
import json
import shutil

import pytest
from tests.crossings import crossing

import repair
from repair.certify.recompute import certify
from repair.cli import main


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A folder with proofs of both kinds, with halved headings and forbidden places."""
    folder = tmp_path_factory.mktemp("bound")
    file = folder / "scenario.xml"
    file.write_text(crossing(11).text, encoding="utf-8")
    config = repair.load_config(
        overrides=["reference.source=constant", "bound.wanted=true", "checker.official=never"]
    )
    result = repair.repair(file, config)
    assert all(bound.proven for bound in result.bounds.values())
    result.save(folder / "result", figure=False)
    return folder / "result"


def proofs(folder):
    return json.loads(gzip.decompress((folder / "bound.json.gz").read_bytes()))


def rewritten(folder, content, target):
    shutil.copytree(folder, target)
    (target / "bound.json.gz").write_bytes(gzip.compress(json.dumps(content).encode()))
    return target


def late(folder):
    """The rows about the bound."""
    rows = certify(folder).rows
    words = ("too late", "record: bound")
    return {row.name: row for row in rows if any(word in row.name for word in words)}


@pytest.fixture(scope="module")
def judged(written, tmp_path_factory):
    """The same rows of changed proofs and records, with the scenario laid out once."""
    from repair.certify.late.rows import late_rows
    from repair.certify.recompute import _prepare, _reference
    from repair.certify.traffic import read_traffic
    from repair.scene.reading import read_file

    record = json.loads((written / "result.json").read_text())
    path, prepared = _prepare(written, record)
    scene, anew = prepared.scene, read_file(path)
    problem = anew.problems[scene.planning_problem_id]
    traffic = read_traffic(anew.scenario, problem, scene, prepared.config, scene.n_steps)
    reference, folder = _reference(record, prepared), tmp_path_factory.mktemp("judged")

    def judge(content, bound=None):
        (folder / "bound.json.gz").write_bytes(gzip.compress(json.dumps(content).encode()))
        said = {**record, "bound": {**record["bound"], **(bound or {}), "proof_sha256": None}}
        rows = late_rows(folder, said, prepared, anew.scenario, traffic, reference)
        return {row.name: row for row in rows}

    return judge


def parts(tree, name):
    """All parts of a tree that have a key."""
    found, stack = [], [tree]
    while stack:
        part = stack.pop()
        found += [part] if name in part else []
        stack += part.get("children", [])
    return found


def of(content, name):
    """The kind whose tree has such a part, and its parts."""
    for kind in content["kinds"].values():
        if found := parts(kind["tree"], name):
            return kind, found
    raise AssertionError(f"no tree has a part with {name}")


def test_it_passes_as_it_is_written(written, judged):
    assert all(row.ok for row in judged(proofs(written)).values())
    rows = late(written)
    assert len(rows) == 3
    assert all(row.ok for row in rows.values())
    assert all("leaves" in row.unit for name, row in rows.items() if "too late" in name)


def _later_start(c):
    c["kinds"]["vehicle"]["start"]["position_m"][0] += 0.01


def _faster(c):
    c["kinds"]["vehicle"]["start"]["velocity_mps"][0] += 0.1


def _turned(c):
    c["kinds"]["search"]["start"]["heading_rad"] += 0.01


def _spinning(c):
    c["kinds"]["search"]["start"]["yaw_rate_radps"] += 0.05


def _shifted_shape(c):
    for corner in c["kinds"]["vehicle"]["places"][0]["shape"]:
        corner[0] += 0.05


def _larger_shape(c):
    place = c["kinds"]["search"]["places"][0]
    x, y = (sum(p[i] for p in place["shape"]) / len(place["shape"]) for i in (0, 1))
    place["shape"] = [[x + 1.02 * (a - x), y + 1.02 * (b - y)] for a, b in place["shape"]]


def _larger_places(c):
    place = c["kinds"]["vehicle"]["places"][0]
    x, y = (sum(p[i] for p in place["corners"]) / len(place["corners"]) for i in (0, 1))
    place["corners"] = [[x + 1.1 * (a - x), y + 1.1 * (b - y)] for a, b in place["corners"]]


def _other_instant(c):
    c["kinds"]["vehicle"]["places"][0]["instant"] += 3


def _other_obstacle(c):
    c["kinds"]["vehicle"]["places"][0]["obstacle"] += 1


def _fewer_headings(c):
    for place in c["kinds"]["search"]["places"]:
        low, high = place["headings"]
        place["headings"] = [0.5 * (low + high)] * 2


def _concave(c):
    corners = c["kinds"]["vehicle"]["places"][0]["corners"]
    corners[0], corners[1] = corners[1], corners[0]


def _fewer_sides(c):
    part = of(c, "cut")[1][0]
    part["sides"], part["children"] = part["sides"][1:], part["children"][1:]


def _the_same_side_twice(c):
    part = next(p for p in of(c, "cut")[1] if "close" in p["children"][0])
    part["sides"][1], part["children"][1] = part["sides"][0], part["children"][0]


def _no_multipliers(c):
    of(c, "close")[1][0]["close"] = []


def _negative_multipliers(c):
    for part in of(c, "close")[1]:
        for row in part["close"]:
            row[-1] = -row[-1]


def _other_multipliers(c):
    for kind in c["kinds"].values():
        for part in parts(kind["tree"], "close"):
            part["close"] = [[*row[:-1], row[-1] ** 4 + 0.01 * i] for i, row in enumerate(part["close"])]


def _rows_from_elsewhere(c):
    kind = of(c, "cut")[0]
    sides = len(kind["places"][0]["corners"])
    for part in parts(kind["tree"], "close"):
        part["close"] = [["place", 0, k, 1, 1.0] for k in range(sides)]


def _an_easy_course(c):
    for kind in c["kinds"].values():
        for part in parts(kind["tree"], "close"):
            for row in part["close"]:
                if row[0] == "course":
                    row[3] += 0.02 if row[2] == 0 else -0.02


def _said_to_be_empty(c):
    part = of(c, "cut")[1][0]
    part.clear()
    part["empty"] = True


def _half_of_the_headings(c):
    _, found = of(c, "split")
    found[0]["children"] = found[0]["children"][:1]


def _other_half(c):
    _, found = of(c, "split")
    found[0]["at"] += 0.2


def _earlier(c):
    c["kinds"]["vehicle"]["t_bound_s"] -= 0.1


def _longer(c):
    c["kinds"]["vehicle"]["instants_s"][-1] += 100.0


def _other_times(c):
    c["kinds"]["vehicle"]["instants_s"] = [1.1 * t for t in c["kinds"]["vehicle"]["instants_s"]]


def _no_kind(c):
    del c["kinds"]["search"]


def _no_tree(c):
    c["kinds"]["search"]["tree"] = {}


MUTATIONS = [value for name, value in list(globals().items()) if name.startswith("_") and callable(value)]
MUTATIONS = [m for m in MUTATIONS if getattr(m, "__module__", None) == __name__]


def test_there_are_twenty():
    assert len(MUTATIONS) >= 20


@pytest.mark.thinned(3)
@pytest.mark.parametrize("mutate", MUTATIONS, ids=lambda m: m.__name__.strip("_"))
def test_it_is_rejected_tampered(written, judged, mutate):
    content = proofs(written)
    before = copy.deepcopy(content)
    mutate(content)
    assert content != before
    assert not all(row.ok for row in judged(content).values())


def _records():
    def vehicle(bound):
        return bound["kinds"]["vehicle"]

    return {
        "earlier": lambda b: vehicle(b).update(t_bound_s=vehicle(b)["t_bound_s"] - 0.05),
        "gap": lambda b: b.update(gap_s=0.1),
        "no gap": lambda b: b.update(gap_s=None),
        "optimal": lambda b: b.update(proven_optimal=not b["proven_optimal"]),
        "at the start": lambda b: b.update(proven_too_late_at_start=not b["proven_too_late_at_start"]),
        "nothing proven": lambda b: b.update(t_bound_s=None),
        "status": lambda b: vehicle(b).update(status="open"),
        "a kind of its own": lambda b: b["kinds"].update(everybody=vehicle(b)),
    }


@pytest.mark.thinned(3)
@pytest.mark.parametrize("said", list(_records()))
def test_a_record_that_says_more_is_rejected(written, judged, said):
    bound = json.loads((written / "result.json").read_text())["bound"]
    before = copy.deepcopy(bound)
    _records()[said](bound)
    assert bound != before
    assert not all(row.ok for row in judged(proofs(written), bound).values())


def test_a_proof_that_is_another_one_is_noticed_though_it_holds(written, tmp_path):
    content = proofs(written)
    leaf = next(p for p in of(content, "close")[1] if len(p["close"]) == 1)
    leaf["close"][0][-1] *= 2.0  # as good as before
    target = rewritten(written, content, tmp_path / "folder")
    assert [row.name for row in certify(target).rows if row.claim and not row.ok] == [
        "record: the proof's checksum"
    ]


@pytest.mark.parametrize(
    "place, value",
    [
        (("tree",), "nothing"),
        (("instants_s", 1), float("nan")),
        (("places", 0, "shape", 0, 0), float("nan")),
        (("places", 0, "instant"), 1.5),
        (("places", 0, "corners"), None),
        (("start",), []),
    ],
)
def test_what_is_no_proof_at_all_is_rejected_too(written, judged, place, value):
    content = proofs(written)
    at = content["kinds"]["vehicle"]
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    rows = judged(content)
    assert [name for name, row in rows.items() if not row.ok] == [n for n in rows if "(vehicle)" in n]


def test_a_file_that_is_none_is_one_sentence(written, tmp_path, capsys):
    target = tmp_path / "folder"
    shutil.copytree(written, target)
    (target / "bound.json.gz").write_bytes(b"nothing")
    assert main(["certify", str(target)]) == 2
    assert "bound.json.gz cannot be read" in capsys.readouterr().err


def test_limits_that_are_higher_need_another_proof(written, tmp_path):
    """The rows are made from scenario and limits, not from the file: stronger brakes break it."""
    target = tmp_path / "folder"
    shutil.copytree(written, target)
    record = json.loads((target / "result.json").read_text())
    record["config"]["limits"]["a_total"] = 14.0
    (target / "result.json").write_text(json.dumps(record))
    rows = late(target)
    assert not next(row for name, row in rows.items() if "(search)" in name).ok
    assert next(row for name, row in rows.items() if "(vehicle)" in name).ok


def test_written_twice_it_is_the_same_file(written, tmp_path):
    config = repair.load_config(
        overrides=["reference.source=constant", "bound.wanted=true", "checker.official=never"]
    )
    result = repair.repair(written.parent / "scenario.xml", config)
    result.save(tmp_path / "again", figure=False)
    assert (tmp_path / "again" / "bound.json.gz").read_bytes() == (written / "bound.json.gz").read_bytes()
