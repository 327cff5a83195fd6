"""The paper's figures, computed anew."""

from __future__ import annotations

from repair.report.birdseye import birdseye_figure
from repair.report.profiles import profile_figure, stages_figure
from repair.report.style import render

__all__ = ["paper_figures"]


def paper_figures(backend: str = "ego", file_format: str = "png") -> dict[str, bytes]:
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

    results = []
    for name in ("scenario_1", "scenario_2"):
        with paper_scenario(name) as path:
            results.append(repair(path, load_config(name, backend=backend)).outcome)
    drawn = {
        "figure_4": profile_figure(results[0]),
        "figure_4_birdseye": birdseye_figure(results[0]),
        "figure_5": stages_figure(results[0]),
        "figure_6": birdseye_figure(results[1]),
        "figure_6_profiles": profile_figure(results[1]),
        "figure_6_stages": stages_figure(results[1]),
    }
    return {f"{name}.{file_format}": render(figure, file_format) for name, figure in drawn.items()}
