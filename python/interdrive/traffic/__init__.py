"""Generated traffic: demand by lane and seed, vehicles that fill the map, their drivers and ways."""

from interdrive.traffic.arrivals import Driver, due_times
from interdrive.traffic.generation import Generated, entered_at, generated, map_alone
from interdrive.traffic.lanes import LaneGraph
from interdrive.traffic.settings import TrafficSettings

__all__ = ["Driver", "Generated", "LaneGraph", "TrafficSettings", "due_times", "entered_at", "generated", "map_alone"]
