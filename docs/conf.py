"""The documentation site: ``python -m sphinx -W -b html docs OUT`` (``pip install -e '.[docs]'``).

It needs nothing from the network when it is read: search is Sphinx's own index, and equations are MathML.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))

_PROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
_VERSION = re.search(r'^version = "([^"]+)"', _PROJECT, re.MULTILINE)
assert _VERSION is not None

project = "commonroad-repair"
author = "The commonroad-repair authors"
project_copyright = f"%Y, {author}"
version = release = _VERSION.group(1)

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
source_suffix = {".md": "markdown"}
suppress_warnings = [
    "myst.header",  # a table of figures may stand two levels below its page
    "ref.python",  # a word of a docstring that is the name of several things
]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 4

autodoc_typehints = "none"  # the signature has them; the docstring says what they mean
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "undoc-members": False}
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
python_use_unqualified_type_names = True

html_theme = "furo"
html_title = f"commonroad-repair {release}"
html_copy_source = False
html_math_renderer = "mathml"


def _mathml(node: nodes.Element, as_block: bool) -> str:
    """An equation as MathML; what cannot be read is a warning, which ends the build."""
    try:
        return str(tex2mathml(node.astext(), as_block=as_block))
    except MathError as error:
        logging.getLogger(__name__).warning("%s", error, location=node)
        return ""


def _inline(self: Any, node: nodes.math) -> None:
    """An equation within a line."""
    self.body.append(_mathml(node, False))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    """An equation of its own, with its number where it has a label."""
    number = f'<span class="eqno">({node["number"]})</span>' if node.get("number") else ""
    self.body.append(f'<div class="math-block">{number}{_mathml(node, True)}</div>\n')
    raise nodes.SkipNode


def _kind(thing: Any) -> tuple[str, str]:
    """The heading under which a public name stands, and the directive that shows it."""
    if isinstance(thing, type):
        return ("Errors", "autoexception") if issubclass(thing, Exception) else ("Classes", "autoclass")
    return "Functions", "autofunction"


def _public_names() -> str:
    """One entry for each name of ``repair.__all__``, by kind."""
    import repair

    groups: dict[str, list[str]] = {"Functions": [], "Registering": [], "Classes": [], "Errors": []}
    for name in repair.__all__:
        thing = getattr(repair, name)
        if isinstance(thing, str):  # the version
            continue
        heading, directive = _kind(thing)
        heading = "Registering" if name.startswith("register_") else heading
        groups[heading].append(f".. {directive}:: repair.{name}")
    return "\n".join(
        f"## {heading}\n\n```{{eval-rst}}\n" + "\n\n".join(entries) + "\n```\n"
        for heading, entries in groups.items()
    )


def _other_pages(listed: str) -> str:
    """The pages that no table of contents names: none is out of reach."""
    return "\n".join(
        page.stem
        for page in sorted(Path(__file__).parent.glob("*.md"))
        if page.stem != "index" and not re.search(rf"^{re.escape(page.stem)}$", listed, re.MULTILINE)
    )


def _written(app: Any, name: str, source: list[str]) -> None:
    """Fill in what is made from the code and from the folder."""
    if name == "api":
        source[0] = source[0].replace("<!-- public names -->", _public_names())
    if name == "index":
        others = _other_pages(source[0])
        tree = f"```{{toctree}}\n:caption: More\n:maxdepth: 1\n\n{others}\n```" if others else ""
        source[0] = source[0].replace("<!-- other pages -->", tree)


def setup(app: Any) -> dict[str, bool]:
    """Equations as MathML, which browsers draw themselves: no script from elsewhere."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("source-read", _written)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
