"""The house: one direction, no circle, no room too large. The order stands in pyproject.toml."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from statistics import median

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "repair"
LINTED = pytest.mark.skipif(sys.version_info < (3, 11), reason="import-linter needs Python 3.11")


def layers() -> list[tuple[str, ...]]:
    """The rooms from the top down, those of one level together."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    listed = re.search(r"^layers = \[(.*?)^\]", text, re.MULTILINE | re.DOTALL)
    assert listed is not None
    return [tuple(level.split(" | ")) for level in re.findall(r'"([^"]+)"', listed.group(1))]


def modules() -> dict[str, Path]:
    """Dotted name to file."""
    found = {}
    for file in SOURCE.rglob("*.py"):
        parts = ("repair", *file.relative_to(SOURCE).with_suffix("").parts)
        found[".".join(parts).removesuffix(".__init__")] = file
    return found


def graph():
    """All imports, those inside functions, under TYPE_CHECKING and by ``"module:name"`` included."""
    import grimp

    made = grimp.build_graph("repair", cache_dir=None)
    for name, file in modules().items():
        for target in re.findall(r'"(repair(?:\.\w+)+):\w+"', file.read_text(encoding="utf-8")):
            assert target in made.modules, f"{name} names {target}, which is not there"
            made.add_import(importer=name, imported=target)
    return made


def illegal(made) -> set:
    from grimp import Layer

    ordered = [Layer(*level, independent=False) for level in layers()]
    return made.find_illegal_dependencies_for_layers(layers=ordered, containers={"repair"})


@LINTED
def test_the_contracts_are_kept():
    from importlinter.cli import lint_imports

    assert lint_imports(config_filename=str(ROOT / "pyproject.toml"), no_cache=True) == 0


@LINTED
def test_no_import_of_any_kind_goes_back_up():
    made = graph()
    assert not illegal(made)
    named = [t for f in modules().values() for t in re.findall(r'"(repair[.\w]+):\w+"', f.read_text("utf-8"))]
    assert len(named) >= 8  # the registries': the test above has looked at them


@LINTED
@pytest.mark.parametrize(
    "importer, imported",
    [
        ("repair.check.checker", "repair.api"),
        ("repair.search.search", "repair.config.load"),
        ("repair.vehicle.parameters", "repair.scene.scene"),
        ("repair.errors", "repair.cli.run"),
    ],
)
def test_a_violation_is_noticed(importer, imported):
    made = graph()
    made.add_import(importer=importer, imported=imported)
    assert any(importer.startswith(f"{found.importer}") for found in illegal(made))


@LINTED
def test_no_two_modules_import_each_other_however_far_apart():
    made = graph()
    for name in made.modules:
        if name == "repair":  # the public names, each with its home
            continue
        behind = made.find_upstream_modules(name)
        assert name not in behind
        used = made.find_modules_directly_imported_by(name)
        circle = [other for other in used if name in made.find_upstream_modules(other)]
        assert not circle, f"{name} and {circle} import each other"


def test_every_room_is_in_the_order():
    rooms = {p.stem for p in SOURCE.iterdir() if p.suffix == ".py" or (p.is_dir() and any(p.glob("*.py")))}
    assert {room for level in layers() for room in level} == rooms - {"__init__"}


def test_the_page_shows_the_same_order():
    text = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
    table = re.search(r"<!-- layers -->\n(.*?)\n<!-- /layers -->", text, re.DOTALL)
    assert table is not None
    rows = [re.findall(r"`([\w/]+)`", row.split("|")[1]) for row in table.group(1).splitlines()[2:]]
    assert rows == [list(level) for level in layers() if level != ("__main__",)]


def test_sizes():
    lines = {
        file.relative_to(SOURCE): len(file.read_text(encoding="utf-8").splitlines())
        for file in SOURCE.rglob("*.py")
    }
    assert not {name: n for name, n in lines.items() if n > 350}
    assert median(lines.values()) < 180
    folders = {folder: len(list(folder.glob("*.py"))) for folder in {SOURCE / name.parent for name in lines}}
    assert not {folder: n for folder, n in folders.items() if n > 12}


def test_no_name_of_ours_is_private_elsewhere():
    """No module takes a private name from another one, and tests stay under ten such uses."""
    private = re.compile(r"^\s*from repair[\w.]* import [^#\n]*\b_[a-z]\w*", re.MULTILINE)
    for file in SOURCE.rglob("*.py"):
        assert not private.search(file.read_text(encoding="utf-8")), file
