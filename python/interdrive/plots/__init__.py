"""Pictures of a run: one still, or an animation. Importing this loads matplotlib."""

from interdrive.plots.animation import animate_run, check_animation, draw_agent_view
from interdrive.plots.criticality import draw_critical_moment, draw_criticality
from interdrive.plots.still import draw_run, save_figure

__all__ = [
    "animate_run",
    "check_animation",
    "draw_agent_view",
    "draw_critical_moment",
    "draw_criticality",
    "draw_run",
    "save_figure",
]
