"""CommonRoad files in and out. The only package that imports commonroad-io."""

from interdrive.files.read import read_scenario, scenario_from_commonroad

__all__ = ["read_scenario", "scenario_from_commonroad"]
