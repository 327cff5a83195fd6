"""What all figures share: size, colours, and how they become files."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from repair.io.plotting import import_matplotlib

__all__ = ["EGO", "OBSTACLE", "OTHERS", "REFERENCE", "STYLE", "WIDTH", "render"]

WIDTH = 8.0  # in; at 150 dots per inch readable at the width of a README
EGO, OBSTACLE, OTHERS, REFERENCE = "#0072B2", "#D55E00", "#8A8A8A", "#000000"
STYLE: Any = {
    "axes.grid": True,
    "grid.alpha": 0.25,
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def render(figure: Any, file_format: str = "png") -> bytes:
    """A figure as the bytes of a file (``png``, ``pdf``, ``svg``), the same bytes for the same figure."""
    import_matplotlib()
    from matplotlib import rc_context

    buffer = BytesIO()
    metadata = {"png": {"Software": None}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(
        file_format
    )
    with rc_context({"svg.hashsalt": "repair"}):  # else the ids in an SVG are random
        figure.savefig(buffer, format=file_format, dpi=150, bbox_inches="tight", metadata=metadata)
    return buffer.getvalue()
