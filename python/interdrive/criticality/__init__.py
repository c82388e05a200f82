"""Criticality of recorded or simulated traffic: all measures per vehicle and time step, and harm of collisions.

found = interdrive.criticality.evaluate(run)
found["ttc"]                   # time to collision along lanes [s], shape (judged, time_steps)
found.extremes["btn"].value    # largest brake threat number, shape (judged,)

Definitions, sources and limits of every measure: docs/reference/criticality.md.
"""

from interdrive.criticality.evaluate import Criticality, CriticalMoment, Extremes, Series, evaluate
from interdrive.criticality.formulas import (
    exposure,
    minimal_stopping_distance,
    proportion_of_stopping_distance,
    required_acceleration,
    required_lateral_acceleration,
    time_headway,
    time_to_collision,
)
from interdrive.criticality.harm import IMPACT_AREAS, AgentHarm, Collisions, agent_harm, collisions, participant_masses
from interdrive.criticality.measures import MEASURES, Measure, measure_named
from interdrive.criticality.settings import CriticalitySettings

__all__ = [
    "IMPACT_AREAS",
    "MEASURES",
    "AgentHarm",
    "Collisions",
    "CriticalMoment",
    "Criticality",
    "CriticalitySettings",
    "Extremes",
    "Measure",
    "Series",
    "agent_harm",
    "collisions",
    "evaluate",
    "exposure",
    "measure_named",
    "minimal_stopping_distance",
    "participant_masses",
    "proportion_of_stopping_distance",
    "required_acceleration",
    "required_lateral_acceleration",
    "time_headway",
    "time_to_collision",
]
