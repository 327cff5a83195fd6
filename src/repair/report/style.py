"""What all figures share: size, colours, and how they become files."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    pass

__all__ = ["EGO", "OBSTACLE", "REFERENCE", "STYLE", "WIDTH", "render"]

WIDTH = 8.0  # in; at 150 dots per inch readable at the width of a README
EGO, OBSTACLE, REFERENCE = "#0072B2", "#D55E00", "#000000"
STYLE: Any = {
    "axes.grid": True,
    "grid.alpha": 0.25,
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def render(figure: Any, file_format: str = "png") -> bytes:
    """A figure as the bytes of a file (``png``, ``pdf``, ``svg``), the same bytes for the same figure."""
    buffer = BytesIO()
    metadata = {"png": {"Software": None}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(
        file_format
    )
    figure.savefig(buffer, format=file_format, dpi=150, bbox_inches="tight", metadata=metadata)
    return buffer.getvalue()
