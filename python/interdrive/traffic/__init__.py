"""Generated traffic: demand by lane and seed, vehicles that fill the map, their drivers and ways."""

from interdrive.traffic.arrivals import Driver, due_times
from interdrive.traffic.generation import Generated, TrafficMaker, entered_at, map_alone, without_recorded_traffic
from interdrive.traffic.lanes import LaneGraph
from interdrive.traffic.settings import TrafficSettings

__all__ = [
    "Driver",
    "Generated",
    "LaneGraph",
    "TrafficMaker",
    "TrafficSettings",
    "due_times",
    "entered_at",
    "map_alone",
    "without_recorded_traffic",
]
