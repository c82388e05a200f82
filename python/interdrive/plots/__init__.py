"""Pictures of a run: one still, or an animation. Importing this loads matplotlib."""

from interdrive.plots.animation import animate_run, check_animation
from interdrive.plots.criticality import draw_critical_moment, draw_criticality
from interdrive.plots.figures import draw_figure, figure_kind
from interdrive.plots.messages import draw_messages
from interdrive.plots.paper import LINES_MAX, chosen_agents, draw_measures, draw_scene, draw_trajectories, draw_velocity
from interdrive.plots.still import draw_run, save_figure

__all__ = [
    "LINES_MAX",
    "animate_run",
    "check_animation",
    "chosen_agents",
    "draw_critical_moment",
    "draw_criticality",
    "draw_figure",
    "draw_measures",
    "draw_messages",
    "draw_run",
    "draw_scene",
    "draw_trajectories",
    "draw_velocity",
    "figure_kind",
    "save_figure",
]
