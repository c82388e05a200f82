"""Runs on rings: how fast planners drive at a density, and how much they carry."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.config.binding import bind, flatten
from interdrive.config.plugins import read_choice
from interdrive.errors import InputError
from interdrive.scenario import STATE_FIELDS, Lanelets, Obstacles, Scenario
from interdrive.simulation import simulate
from interdrive.storage import Column, arrow_table
from interdrive.traffic.filling import equilibrium_speed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.config.schema import SimulationSettings
    from interdrive.runs import Run
    from interdrive.storage import ArrowTable

#: Densities of a study [1/km], per lane.
DENSITIES = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 60.0, 80.0, 100.0)
#: Speed limit [m/s]: 100 km/h.
_LIMIT = 100.0 / 3.6
#: Rings are at least this long [m], and longer than what a vehicle drives by this: lanes of `idm_mobil` go around once.
_LENGTH_MIN, _SPARE = 1000.0, 400.0
#: Length of cars and the time gap by which the way of a vehicle is estimated [m], [s].
_CAR, _GAP = 4.6, 0.8
_LANE_WIDTH, _LANELETS = 3.75, 8
#: Time between steps [s].
_DT = 0.1
#: What all runs have: cars alike, with the time gap of their planner.
_OWN = {
    "record.violations": False,
    "record.orders": False,
    "traffic.mix": (1.0, 0.0, 0.0),
    "traffic.speed_factor": (1.0, 0.0),
    "traffic.time_gap": None,
}
#: Settings that change nothing here.
_IDLE = ("traffic.", "agents.", "goal.", "recording.", "source.")

COLUMNS = (
    Column("planner", "text", "who drives all vehicles"),
    Column("lanes", "integer", "number of lanes of the ring"),
    Column("density", "number", "vehicles per km and lane", "1/km"),
    Column("vehicles", "integer", "number of vehicles"),
    Column("length", "number", "of the ring", "m"),
    Column("speed", "number", "mean over vehicles and time", "m/s"),
    Column("spread", "number", "standard deviation of speeds over vehicles and time", "m/s"),
    Column("flow", "number", "density times mean speed: vehicles per hour and lane", "1/h"),
    Column("collisions", "integer", "vehicles that collided or left the road"),
)


@dataclass(frozen=True)
class FlowStudy:
    """A fundamental diagram.

    Attributes:
        table: One row per planner, number of lanes and density (`COLUMNS`).
        planners: What was compared.
        predictor: Of all vehicles.
        duration: Length of each run [s]. warm_up: What counts begins then [s].
        settings: Of the runs, as they were driven; planner and density are those of the row.
        seed: Of the traffic.
    """

    table: ArrowTable
    planners: tuple[str, ...]
    predictor: str
    duration: float
    warm_up: float
    settings: Mapping[str, Any]
    seed: int


def flow_study(
    planners: Sequence[str],
    *,
    densities: Sequence[float] = DENSITIES,
    lanes: Sequence[int] = (1, 2),
    duration: float = 150.0,
    warm_up: float = 90.0,
    predictor: str = "lane_following",
    settings: SimulationSettings,
    seed: int = 0,
    threads: int | None = None,
    on_run: Callable[[str, int, int], None] | None = None,
) -> FlowStudy:
    """Drives rings of some lanes at some densities with each planner.

    All vehicles are cars with the planner's own time gap and a limit of 100 km/h. They begin with gaps that differ by a
    fifth, in equilibrium.

    Args:
        planners: Names of planners, with settings if you like.
        densities: Vehicles per km and lane.
        lanes: Numbers of lanes.
        duration: Length of each run [s].
        warm_up: What counts begins then [s].
        predictor: Of all vehicles.
        settings: Of all runs.
        seed: Of the traffic.
        threads: Threads that plan; results do not depend on them.
        on_run: Called after every run with its name, its number and that of all runs.

    Raises:
        InputError: A planner or setting cannot be used or has no effect, something is there twice, or the warm-up
            leaves no time.
    """
    _check(planners, densities, settings)
    if warm_up >= duration:
        raise InputError("warm_up", f"{warm_up:g} s leave nothing of {duration:g} s to count")
    asked = [(planner, n, density) for planner in planners for n in lanes for density in densities]
    rows: list[dict[str, Any]] = []
    own = bind(settings, {**_OWN, "traffic.duration": duration, "traffic.warm_up": warm_up})
    for planner, n, density in asked:
        name, given = _separated(planner)
        speed = equilibrium_speed(max(0.0, 1000.0 / density - _CAR), _LIMIT, _GAP)
        length = max(_LENGTH_MIN, speed * duration + _SPARE)
        run = simulate(
            ring_road(length, n),
            agents=0,
            predictor=predictor,
            settings=bind(own, {f"planner.{name}.{key}": value for key, value in given.items()}),
            traffic={"planner": name, "density": density},
            seed=seed,
            threads=threads,
        )
        rows.append({"planner": planner, "lanes": n, "length": length, **_measured(run, n * length, warm_up)})
        if on_run is not None:
            on_run(f"{planner}, {density:g} per km", len(rows), len(asked))
    table = arrow_table(COLUMNS, {column.name: [row[column.name] for row in rows] for column in COLUMNS})
    used = {name: value for name, value in flatten(own).items() if name not in ("traffic.planner", "traffic.density")}
    return FlowStudy(table, tuple(planners), predictor, duration, warm_up, used, seed)


def _separated(planner: str) -> tuple[str, dict[str, Any]]:
    """Name and settings of a planner; a mix has neither settings nor one name."""
    choice = read_choice(planner, "planner")
    return str(choice.chosen), dict(choice.settings)


def _check(planners: Sequence[str], densities: Sequence[float], settings: SimulationSettings) -> None:
    """Refuses what is there twice, and settings that the study replaces or that rings know nothing of."""
    for name, given in (("planner", planners), ("density", densities)):
        for one in given:
            if list(given).count(one) > 1:
                raise InputError(name, f"{one if isinstance(one, str) else f'{one:g}'} is given twice")
    usual = flatten(type(settings)())
    for name, value in flatten(settings).items():
        if value != usual[name] and name.startswith(_IDLE):
            raise InputError(name, "has no effect on a study of flow, which makes its own traffic on rings")


def _measured(run: Run, lane_length: float, warm_up: float) -> dict[str, Any]:
    states, vehicles = run.states, len(run.agents)
    first = min(round(warm_up / run.scenario.dt), states.n_steps - 1)
    speeds = states.velocity[:, first:][states.valid[:, first:]]
    density = 1000.0 * vehicles / lane_length
    speed = float(speeds.mean()) if len(speeds) else 0.0
    return {
        "density": density,
        "vehicles": vehicles,
        "speed": speed,
        "spread": float(speeds.std()) if len(speeds) else 0.0,
        "flow": 3.6 * density * speed,
        "collisions": run.outcomes.outcome.count("collision"),
    }


def ring_road(length: float, lanes: int) -> Scenario:
    """A road in a circle, driven counter-clockwise, with a limit of 100 km/h.

    Args:
        length: Of its outer lane [m].
        lanes: Number of lanes.
    """
    ids, left, right, after, before = [], [], [], [], []
    for lane in range(lanes):
        radius = length / math.tau - lane * _LANE_WIDTH
        for i in range(_LANELETS):
            angles = np.linspace(i, i + 1, math.ceil(length / _LANELETS / 5.0) + 1) * math.tau / _LANELETS
            circle = np.column_stack([np.cos(angles), np.sin(angles)])
            left.append((radius - 0.5 * _LANE_WIDTH) * circle)
            right.append((radius + 0.5 * _LANE_WIDTH) * circle)
            ids.append(lane * _LANELETS + i + 1)
            after.append((lane * _LANELETS + (i + 1) % _LANELETS + 1,))
            before.append((lane * _LANELETS + (i - 1) % _LANELETS + 1,))
    inner = np.array([number + _LANELETS if number + _LANELETS <= len(ids) else -1 for number in ids])
    outer = np.array([number - _LANELETS if number > _LANELETS else -1 for number in ids])
    lanelets = Lanelets(
        ids=np.array(ids, dtype=np.int64),
        left=tuple(left),
        right=tuple(right),
        predecessors=tuple(before),
        successors=tuple(after),
        adjacent_left=inner,
        adjacent_left_same_direction=inner >= 0,
        adjacent_right=outer,
        adjacent_right_same_direction=outer >= 0,
        speed_limit=np.full(len(ids), _LIMIT),
        types=((),) * len(ids),
    )
    tables: dict[str, Any] = {field: np.zeros((0, 1)) for field in STATE_FIELDS}
    nobody = Obstacles(
        ids=np.zeros(0, dtype=np.int64),
        kinds=(),
        shapes=(),
        is_static=np.zeros(0, dtype=np.bool_),
        valid=np.zeros((0, 1), dtype=np.bool_),
        **tables,
    )
    name = f"ring_{lanes}_{length:.0f}"
    return Scenario(name, name, _DT, lanelets, nobody, ())
