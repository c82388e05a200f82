"""A run made by hand: a bent road with two lanes one way, one back and a side road, six vehicles, four of them agents.

Agent 1 reaches its goal, agent 2 changes lane and hits the pedestrian's parked car, agent 3 turns off and comes too
late, agent 4 breaks. A recorded truck, a parked car, a bush (polygon) and a pedestrian (circle) stand around.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interdrive.run import (
    PHASES,
    AgentRecord,
    Outcomes,
    Plans,
    States,
    Timings,
)
from interdrive.runs import Run
from interdrive.scenario import GoalState, Lanelets, Obstacles, Scenario, Shape

N_STEPS = 60
DT = 0.1


def along(s, offset):
    """Point and heading of a road that runs straight for 80 m and then bends to the left (radius 80 m)."""
    s = np.asarray(s, dtype=float)
    angle = np.clip((s - 80.0) / 80.0, 0.0, None)
    x = np.minimum(s, 80.0) + 80.0 * np.sin(angle)
    y = 80.0 * (1.0 - np.cos(angle))
    return np.stack([x - offset * np.sin(angle), y + offset * np.cos(angle)], axis=-1), angle


def lanelets():
    s = np.linspace(0.0, 160.0, 81)
    side = np.linspace(-40.0, -1.75, 20)
    right, left = along(s, -1.75)[0], along(s, 1.75)[0]
    far, back = along(s, 5.25)[0], along(s, 8.75)[0]
    none = np.array([-1, -1, -1, -1])
    return Lanelets(
        ids=np.array([10, 11, 12, 13]),
        left=(left, far, far[::-1], np.stack([np.full(20, 58.0), side], axis=1)),
        right=(right, left, back[::-1], np.stack([np.full(20, 61.5), side], axis=1)),
        predecessors=((), (), (), ()),
        successors=((), (), (), ()),
        adjacent_left=np.array([11, 12, 11, -1]),
        adjacent_left_same_direction=np.array([True, False, False, False]),
        adjacent_right=np.array([-1, 10, -1, -1]),
        adjacent_right_same_direction=np.array([False, True, False, False]),
        speed_limit=none * np.nan,
        types=(("urban",), ("urban",), ("urban",), ("urban",)),
    )


def tracks():
    """(id, kind, agent, first step, positions, headings) of all participants."""
    t = np.arange(N_STEPS) * DT
    made = []

    def on_road(participant, kind, agent, s, offset, first=0, last=N_STEPS):
        points, heading = along(s, offset)
        made.append((participant, kind, agent, first, last, points, heading))

    on_road(1, "car", True, 10.0 + 14.0 * t, 0.0)
    change = 3.5 / (1.0 + np.exp(-(t - 2.0) * 2.0))
    on_road(2, "car", True, 5.0 + 17.0 * t, change, last=48)
    points = np.stack([np.full(N_STEPS, 59.75), -35.0 + 6.0 * t], axis=1)
    made.append((3, "motorcycle", True, 0, N_STEPS, points, np.full(N_STEPS, np.pi / 2)))
    on_road(4, "bus", True, 30.0 + 8.0 * t, 3.5, first=5, last=40)
    points, heading = along(150.0 - 12.0 * t, 7.0)
    made.append((21, "truck", False, 0, N_STEPS, points, heading + np.pi))
    on_road(22, "parked_vehicle", False, np.full(N_STEPS, 95.0), 3.5)
    on_road(23, "structure", False, np.full(N_STEPS, 40.0), -5.0)
    on_road(24, "pedestrian", False, 70.0 + 1.2 * t, -3.0)
    return made


SIZES = {
    1: (4.5, 1.8),
    2: (4.6, 1.9),
    3: (2.2, 0.8),
    4: (12.0, 2.5),
    21: (9.0, 2.5),
    22: (4.4, 1.8),
    23: (4.0, 3.0),
    24: (0.6, 0.6),
}


def states():
    made = tracks()
    shape = (len(made), N_STEPS)
    table = {name: np.full(shape, np.nan) for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")}
    valid = np.zeros(shape, dtype=bool)
    for row, (_, _, _, first, last, points, heading) in enumerate(made):
        steps = slice(first, last)
        valid[row, steps] = True
        table["x"][row, steps] = points[steps, 0]
        table["y"][row, steps] = points[steps, 1]
        table["orientation"][row, steps] = heading[steps]
        table["velocity"][row, steps] = np.hypot(*np.gradient(points[steps], DT, axis=0).T)
        table["acceleration"][row, steps] = 0.0
    ids = [track[0] for track in made]
    return States(
        participant_id=np.array(ids),
        kinds=tuple(track[1] for track in made),
        first_time_step=0,
        is_agent=np.array([track[2] for track in made]),
        is_static=np.array([number in (22, 23) for number in ids]),
        length=np.array([SIZES[number][0] for number in ids]),
        width=np.array([SIZES[number][1] for number in ids]),
        valid=valid,
        **table,
    )


def shape_of(participant, length, width):
    if participant == 23:
        return Shape("polygon", vertices=np.array([(-2.0, -1.5), (2.0, -1.5), (1.0, 1.5), (-2.0, 1.0)]))
    if participant == 24:
        return Shape("circle", radius=0.3)
    return Shape("rectangle", length=length, width=width)


def scenario(recorded):
    return Scenario(
        name="bend",
        benchmark_id="ZAM_Bend-1_1_T-1",
        dt=DT,
        lanelets=lanelets(),
        obstacles=Obstacles(
            ids=recorded.participant_id,
            kinds=recorded.kinds,
            shapes=tuple(
                shape_of(*item) for item in zip(recorded.participant_id, recorded.length, recorded.width, strict=True)
            ),
            is_static=recorded.is_static,
            x=recorded.x,
            y=recorded.y,
            orientation=recorded.orientation,
            velocity=recorded.velocity,
            acceleration=recorded.acceleration,
            yaw_rate=np.where(recorded.valid, 0.0, np.nan),
            valid=recorded.valid,
        ),
        planning_problems=(),
        notes=("obstacle 24: orientation derived from its motion",),
    )


def goal(s, offset):
    corners = [along(s + ds, offset + dd)[0] for ds, dd in ((-6, -1.5), (6, -1.5), (6, 1.5), (-6, 1.5))]
    area = Shape("polygon", vertices=np.array(corners))
    return (GoalState(areas=(area,), lanelet_ids=(), time_step=(40, 60)),)


def plans(recorded, points=31):
    made = []
    for row, participant in enumerate(recorded.participant_id):
        if not recorded.is_agent[row]:
            continue
        for step in np.flatnonzero(recorded.valid[row]):
            made.append((int(step), int(participant), row))
    made.sort()
    table = {
        name: np.full((len(made), points), np.nan) for name in ("x", "y", "orientation", "velocity", "acceleration")
    }
    for index, (step, participant, row) in enumerate(made):
        ahead = np.arange(points) * DT
        speed, heading = recorded.velocity[row, step], recorded.orientation[row, step]
        turn = 0.15 * heading * ahead
        table["x"][index] = recorded.x[row, step] + speed * ahead * np.cos(heading + turn / 2)
        table["y"][index] = recorded.y[row, step] + speed * ahead * np.sin(heading + turn / 2)
        table["orientation"][index] = heading + turn
        table["velocity"][index] = speed
        table["acceleration"][index] = 0.0
        if participant == 3:  # a shorter plan
            for column in table.values():
                column[index, 21:] = np.nan
        if participant == 4 and step == 39:  # no plan at all
            for column in table.values():
                column[index] = np.nan
    status = np.array([4 if (who, step) == (4, 39) else 2 if (who, step) == (2, 47) else 1 for step, who, _ in made])
    return Plans(
        time_step=np.array([item[0] for item in made]),
        agent_id=np.array([item[1] for item in made]),
        status=status,
        cost=np.where(status == 1, 12.5, np.nan),
        **table,
        rejection=tuple("collision with 24" if code == 2 else "" for code in status.tolist()),
        **{name: np.where(status == 2, 3.5, np.nan) for name in ("rejection_x", "rejection_y")},
        rejection_overhang=np.full(len(status), np.nan),
        turn=np.full(len(status), np.nan),
    )


def outcomes(agent_id, outcome, **columns):
    """Outcomes of agents; columns that are not named say nothing: no partner, no overhang, no words."""
    found = {"agent_id": np.asarray(agent_id), "outcome": tuple(outcome), **columns}
    for name, column in Outcomes.stored.items():
        nothing = np.full(len(agent_id), column.absent)
        if column.kind in ("text", "label"):
            nothing = ("",) * len(agent_id)
        elif not column.nullable:
            nothing = np.zeros_like(nothing)
        found.setdefault(name, nothing)
    return Outcomes(**found)


def invented_run(**changes):
    """The run; `changes` replace its parts."""
    recorded = states()
    ended = outcomes(
        [1, 2, 3, 4],
        ("goal_reached", "collision", "goal_reached_late", "planner_error"),
        planner=("frenet",) * 4,
        time_step=np.array([59, 47, 59, 39]),
        partner_id=np.array([-1, 22, -1, -1]),
        impact_speed=np.array([np.nan, 17.0, np.nan, np.nan]),
        off_lanelets=np.array([0.0, 0.0, 0.25, 0.0]),
        off_lanelets_s=np.array([0.0, 0.0, 1.5, 0.0]),
        message=("", "with parked_vehicle 22", "", "ZeroDivisionError: division by zero"),
        reason=("", "ran into 22 from behind", "late", "ZeroDivisionError: division by zero"),
        traceback=("", "", "", 'File "mine.py", line 8, in plan\nZeroDivisionError: division by zero'),
    )
    agents = tuple(
        AgentRecord(
            id=number,
            planner="frenet",
            origin="recorded",
            start_time_step=5 if number == 4 else 0,
            goal=goal(s, offset),
            route_lanelet_ids=(10,),
            reference_path=along(np.linspace(0, 160, 50), offset)[0],
        )
        for number, s, offset in ((1, 95.0, 0.0), (2, 120.0, 3.5), (3, 110.0, 0.0), (4, 130.0, 3.5))
    )
    seconds = np.tile([0.001, 0.0005, 0.015, 0.0, 0.0002, 0.0001, 0.0002], N_STEPS)
    run = Run(
        scenario=scenario(recorded),
        settings={
            "agents": "all",
            "planner": "frenet",
            "predictor": "lane_following",
            "seed": 0,
            "settings": {"planner.frenet.horizon": 3.0, "goal.time_early": float("inf")},
        },
        agents=agents,
        outcomes=ended,
        states=recorded,
        plans=plans(recorded),
        timings=Timings(np.repeat(np.arange(N_STEPS), len(PHASES)), PHASES * N_STEPS, seconds),
        notes=("vehicle 21 stays recorded: it leaves the map",),
        digest="0" * 64,
    )
    return replace(run, **changes)
