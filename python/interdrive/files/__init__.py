"""Reads and writes CommonRoad files. The only package that imports commonroad-io, besides the planner `reactive`."""

from interdrive.files.content import content_of_file, content_of_input
from interdrive.files.later import later
from interdrive.files.osi_export import write_osi
from interdrive.files.protobuf import scenario_parts
from interdrive.files.read import (
    ScenarioSpec,
    is_source,
    join,
    open_scenario,
    read_scenario,
    read_source,
    scenario_from_commonroad,
)
from interdrive.files.scenario_file import road_losses, write_scenario
from interdrive.files.shipped import (
    FOLDER_VARIABLE,
    recorded_scenario,
    scenario_file,
    scenario_folders,
    shipped_scenario,
    shipped_scenarios,
)
from interdrive.files.sources import content_sha256
from interdrive.files.sumo_export import sumo_files
from interdrive.files.tracks_export import run_tracks
from interdrive.files.write import CommonRoadObjects, commonroad_objects, run_document, scenario_document

__all__ = [
    "FOLDER_VARIABLE",
    "CommonRoadObjects",
    "ScenarioSpec",
    "commonroad_objects",
    "content_of_file",
    "content_of_input",
    "content_sha256",
    "is_source",
    "join",
    "later",
    "open_scenario",
    "read_scenario",
    "read_source",
    "recorded_scenario",
    "road_losses",
    "run_document",
    "run_tracks",
    "scenario_document",
    "scenario_file",
    "scenario_folders",
    "scenario_from_commonroad",
    "scenario_parts",
    "shipped_scenario",
    "shipped_scenarios",
    "sumo_files",
    "write_osi",
    "write_scenario",
]
