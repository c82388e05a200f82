"""Fundamental diagrams: flow and speed of planners over density, on rings of one and two lanes."""

from interdrive.studies.flow.figure import flow_figure
from interdrive.studies.flow.folder import FLOW_FOLDER, save_flow
from interdrive.studies.flow.measure import COLUMNS, DENSITIES, FlowStudy, flow_study
from interdrive.studies.flow.summary import Capacity, capacities

__all__ = [
    "COLUMNS",
    "DENSITIES",
    "FLOW_FOLDER",
    "Capacity",
    "FlowStudy",
    "capacities",
    "flow_figure",
    "flow_study",
    "save_flow",
]
