"""CommonRoad-CriMe 0.4.5 as a black box, and the roads and cars on which it can be compared.

Its package file imports everything, also what has no wheels; so the measures are imported one by one, and packages that
they never call are stand-ins.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import logging
import sys
import types
import warnings
from dataclasses import dataclass

import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.intersection import Intersection, IntersectionIncomingElement
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, ScenarioID, Tag
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory

MEASURES = {
    "hw": ("distance.hw", "HW"),
    "thw": ("time.thw", "THW"),
    "ttc": ("time.ttc", "TTC"),
    "tet": ("time.tet", "TET"),
    "tit": ("time.tit", "TIT"),
    "dce": ("distance.dce", "DCE"),
    "ttce": ("time.ttce", "TTCE"),
    "et": ("time.et", "ET"),
    "pet": ("time.pet", "PET"),
    "a_long_req": ("acceleration.a_long_req", "ALongReq"),
    "btn": ("index.btn", "BTN"),
    "a_lat_req": ("acceleration.a_lat_req", "ALatReq"),
    "stn": ("index.stn", "STN"),
    "psd": ("distance.psd", "PSD"),
    "msd": ("distance.msd", "MSD"),
}

LENGTH, WIDTH, DT = 5.0, 2.0, 0.1
#: Of CriMe's road: at exactly 0 it returns no required acceleration, at larger angles its headway is wrong.
HEADING = 1e-4


def _prepare() -> None:
    if "commonroad_crime.measure" in sys.modules:
        return
    root = importlib.util.find_spec("commonroad_crime").submodule_search_locations[0]
    for name in ("", ".time", ".distance", ".index", ".acceleration"):
        module = types.ModuleType(f"commonroad_crime.measure{name}")
        module.__path__ = [f"{root}/measure{name.replace('.', '/')}"]
        sys.modules[module.__name__] = module
    for name in ("Polygon", "osqp", "casadi", "imageio", "imageio.v3"):
        sys.modules.setdefault(name, types.ModuleType(name))


class CriMe:
    """Measures of one vehicle of a scenario."""

    def __init__(self, scenario: Scenario, ego: int) -> None:
        _prepare()
        configuration = importlib.import_module("commonroad_crime.data_structure.configuration")
        logging.disable(logging.CRITICAL)
        self.config = configuration.CriMeConfiguration()
        with self._quiet():
            scenario.assign_obstacles_to_lanelets()
            self.config.update(ego_id=ego, sce=scenario)

    @contextlib.contextmanager
    def _quiet(self):
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield

    def measure(self, name: str):
        """CriMe's object for a measure."""
        path, cls = MEASURES[name]
        with self._quiet():
            return getattr(importlib.import_module(f"commonroad_crime.measure.{path}"), cls)(self.config)

    def compute(self, name: str, other: int, steps: range | list[int]) -> np.ndarray:
        """Values at some time steps, shape (steps,)."""
        measure = self.measure(name)
        with self._quiet():
            values = [measure.compute(other, step, verbose=False) for step in steps]
        return np.array([np.nan if value is None else value for value in values], dtype=float)


@dataclass(frozen=True)
class Way:
    """A car with constant acceleration on a straight way: where it starts, which way, how fast."""

    x: float
    y: float
    heading: float
    velocity: float
    acceleration: float = 0.0

    def states(self, n: int) -> list[tuple[np.ndarray, float]]:
        """Positions and speeds at `n` time steps."""
        time = np.arange(n) * DT
        along = self.velocity * time + 0.5 * self.acceleration * time**2
        x, y = self.x + along * np.cos(self.heading), self.y + along * np.sin(self.heading)
        return list(zip(np.column_stack([x, y]), self.velocity + self.acceleration * time, strict=True))


def car(number: int, way: Way, n: int) -> DynamicObstacle:
    states = way.states(n)
    shape = Rectangle(LENGTH, WIDTH)
    common = {"orientation": way.heading, "acceleration": way.acceleration, "velocity_y": 0.0, "acceleration_y": 0.0}
    initial = InitialState(
        time_step=0,
        position=states[0][0],
        velocity=states[0][1],
        orientation=way.heading,
        acceleration=way.acceleration,
        yaw_rate=0.0,
        slip_angle=0.0,
    )
    later = [
        CustomState(time_step=k, position=position, velocity=velocity, **common)
        for k, (position, velocity) in enumerate(states[1:], start=1)
    ]
    prediction = TrajectoryPrediction(Trajectory(1, later), shape)
    return DynamicObstacle(number, ObstacleType.CAR, shape, initial, prediction)


def lanelet(
    number: int, start: tuple[float, float], heading: float, length: float, width: float, **relations
) -> Lanelet:
    along = np.linspace(0.0, length, max(2, round(length / 2.0) + 1))
    way, aside = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    center = np.array(start) + along[:, None] * way
    return Lanelet(center + 0.5 * width * aside, center, center - 0.5 * width * aside, number, **relations)


def _scenario(lanelets: list[Lanelet], cars: list[DynamicObstacle]) -> Scenario:
    scenario = Scenario(DT, ScenarioID.from_benchmark_id("ZAM_Oracle-1_1_T-1", "2020a"))
    scenario.add_objects(LaneletNetwork.create_from_lanelet_list(lanelets))
    scenario.add_objects(cars)
    return scenario


def straight(own: Way, other: Way, n: int) -> Scenario:
    """Two cars, ids 1 and 2, on one straight lanelet of 500 m."""
    return _scenario([lanelet(100, (0.0, 0.0), HEADING, 500.0, 4.0)], [car(1, own, n), car(2, other, n)])


def crossing(own: Way, other: Way, n: int) -> Scenario:
    """Two cars, ids 1 and 2, on two roads of 4 m width that cross at right angles in the origin."""
    up = 0.5 * np.pi
    lanelets = [
        lanelet(101, (-110.0, 0.0), 0.0, 100.0, 4.0, successor=[102]),
        lanelet(102, (-10.0, 0.0), 0.0, 20.0, 4.0, predecessor=[101], successor=[103]),
        lanelet(103, (10.0, 0.0), 0.0, 100.0, 4.0, predecessor=[102]),
        lanelet(111, (0.0, -110.0), up, 100.0, 4.0, successor=[112]),
        lanelet(112, (0.0, -10.0), up, 20.0, 4.0, predecessor=[111], successor=[113]),
        lanelet(113, (0.0, 10.0), up, 100.0, 4.0, predecessor=[112]),
    ]
    scenario = _scenario(lanelets, [car(1, own, n), car(2, other, n)])
    incomings = [
        IntersectionIncomingElement(201, {101}, set(), {102}, set()),
        IntersectionIncomingElement(202, {111}, set(), {112}, set()),
    ]
    scenario.add_objects(Intersection(200, incomings))
    scenario.tags = {Tag.INTERSECTION}
    return scenario
