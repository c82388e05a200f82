"""Reads and writes CommonRoad files. The only package that imports commonroad-io, besides the planner `reactive`."""

from interdrive.files.content import content_of_file, content_of_input
from interdrive.files.read import ScenarioSpec, open_scenario, read_scenario, scenario_from_commonroad, scenario_parts
from interdrive.files.shipped import FOLDER_VARIABLE, scenario_file, shipped_scenario, shipped_scenarios
from interdrive.files.write import CommonRoadObjects, commonroad_objects, write_scenario

__all__ = [
    "FOLDER_VARIABLE",
    "CommonRoadObjects",
    "ScenarioSpec",
    "commonroad_objects",
    "content_of_file",
    "content_of_input",
    "open_scenario",
    "read_scenario",
    "scenario_file",
    "scenario_from_commonroad",
    "scenario_parts",
    "shipped_scenario",
    "shipped_scenarios",
    "write_scenario",
]
