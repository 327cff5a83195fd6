"""What all figures share: size, colours, and how they become files."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from typing import Any

from repair.errors import OutputError, in_words
from repair.io.plotting import import_matplotlib

__all__ = ["EGO", "FORMATS", "OBSTACLE", "OTHERS", "REFERENCE", "FigureStyle", "render"]

EGO, OBSTACLE, OTHERS, REFERENCE = "#0072B2", "#D55E00", "#8A8A8A", "#000000"
FORMATS = ("png", "pdf", "svg")
_WIDTHS, _SIZES = (2.0, 40.0), (4.0, 40.0)  # [in], [pt]
_RC: dict[str, Any] = {
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


@dataclass(frozen=True)
class FigureStyle:
    """How figures are written: by default readable at the width of a page on a screen.

    Attributes
    ----------
    format : str
        ``png`` (150 dots per inch), ``pdf`` or ``svg``.
    width : float
        [in]; the height follows. A column of a paper has about 3.5.
    font_size : float
        [pt]

    Raises
    ------
    OutputError
        If one of them is none that is possible.
    """

    format: str = "png"
    width: float = 8.0
    font_size: float = 9.5

    def __post_init__(self) -> None:
        if self.format not in FORMATS:
            raise OutputError(
                f"the format {in_words(self.format)} of figures is none of {', '.join(FORMATS)}"
            )
        for name, value, (low, high), unit in (
            ("width", self.width, _WIDTHS, "in"), ("font size", self.font_size, _SIZES, "pt"),
        ):  # fmt: skip
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not number or not low <= value <= high:
                raise OutputError(
                    f"the {name} of figures is {in_words(value)}; it has to be {low:g} to {high:g} {unit}"
                )

    @property
    def rc(self) -> Any:
        """For matplotlib's ``rc_context``."""
        smaller = ("axes.titlesize", "axes.labelsize", "xtick.labelsize", "ytick.labelsize")
        few = dict.fromkeys(smaller, "small") if self.narrow else {}
        return {**_RC, "font.size": self.font_size, "lines.markersize": 4.5, **few}

    @property
    def narrow(self) -> bool:
        """Whether there is no room for a legend beside what is drawn."""
        return self.width < 70.0 * self.font_size / 100.0


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
