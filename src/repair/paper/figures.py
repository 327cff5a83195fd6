"""The paper's figures, computed anew."""

from __future__ import annotations

from repair.report.birdseye import birdseye_figure
from repair.report.profiles import profile_figure, stages_figure
from repair.report.style import FigureStyle, render

__all__ = ["paper_figures"]


def paper_figures(backend: str = "ego", style: FigureStyle | None = None) -> dict[str, bytes]:
    """The paper's Figures 4 and 5 (Scenario 1) and 6 (Scenario 2), computed anew.

    The view from above of Scenario 1 belongs to Figure 4; the other drawings of Scenario 2 are not in
    the paper.

    Returns
    -------
    dict
        File name to content.
    """
    from repair.api import repair
    from repair.config import load_config
    from repair.paper.bundled import paper_scenario

    style, results = style or FigureStyle(), []
    for name in ("scenario_1", "scenario_2"):
        with paper_scenario(name) as path:
            results.append(repair(path, load_config(name, backend=backend)).outcome)
    drawn = {
        "figure_4": profile_figure(results[0], style),
        "figure_4_birdseye": birdseye_figure(results[0], style),
        "figure_5": stages_figure(results[0], style=style),
        "figure_6": birdseye_figure(results[1], style),
        "figure_6_profiles": profile_figure(results[1], style),
        "figure_6_stages": stages_figure(results[1], style=style),
    }
    return {f"{name}.{style.format}": render(figure, style.format) for name, figure in drawn.items()}
