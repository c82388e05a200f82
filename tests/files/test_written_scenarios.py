"""Scenarios made in Python, or from files that are gone, are the same after writing and reading."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import interdrive as idr
from interdrive.errors import InputError
from interdrive.scenario import GoalState, Incoming, InitialState, PlanningProblem, Priorities, StopLine, TrafficLight
from interdrive.testing import Car, crossing, problem, straight_road, world

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.scenario import Lanelets, Scenario


def made(lanelets: Lanelets, minor: tuple[int, ...] = (4,), **contents: Any) -> Scenario:
    return replace(world(lanelets, **contents), priorities=Priorities(minor=minor))


def junction() -> Lanelets:
    """Lanelet 1 (0 to 50 m) leads to 2 (straight on) and 3 (left, a bend by 90 degrees); 4 comes from the right."""
    x = np.linspace(0.0, 50.0, 11)
    turn = np.linspace(0.0, 0.5 * np.pi, 12)

    def along(start: float, y: float) -> NDArray[np.float64]:
        return np.column_stack((start + x, np.full_like(x, y)))

    def bend(radius: float) -> NDArray[np.float64]:
        return np.column_stack((50.0 + radius * np.sin(turn), 20.0 - radius * np.cos(turn)))

    up = np.linspace(-50.0, 50.0, 21)
    left = (along(0.0, 1.75), along(50.0, 1.75), bend(18.25), np.column_stack((np.full_like(up, 68.25), up)))
    right = (along(0.0, -1.75), along(50.0, -1.75), bend(21.75), np.column_stack((np.full_like(up, 71.75), up)))
    none = np.full(4, -1, dtype=np.int64)
    return replace(
        straight_road(10.0),
        ids=np.array([1, 2, 3, 4], dtype=np.int64),
        left=left,
        right=right,
        predecessors=((), (1,), (1,), ()),
        successors=((2, 3), (), (), ()),
        adjacent_left=none,
        adjacent_left_same_direction=none > 0,
        adjacent_right=none,
        adjacent_right_same_direction=none > 0,
        speed_limit=np.array([50.0 / 3.6, 50.0 / 3.6, np.nan, 8.1]),
        types=(("urban",), ("country", "urban"), (), ("driveWay",)),
        left_marking=("solid", "unknown", "dashed", "solid_solid"),
        right_marking=("curb", "unknown", "no_marking", "solid"),
        users=((), ("bus", "vehicle"), (), ("car",)),
    )


LIGHTS = (
    TrafficLight(50, (("red", 40), ("green", 30), ("yellow", 5)), offset=3, directions=frozenset(("straight",))),
    TrafficLight(51, (("green", 20), ("dark", 2), ("red", 9)), directions=frozenset(("left",)), position=(50.0, 3.3)),
    TrafficLight(52, (), directions=frozenset(("left", "right")), position=(0.1, 0.2)),
)
ASKED = problem(101, 5.0, goal=(90.0, 0.0), time_step=(0, 150))


def everything() -> Scenario:
    lines = (
        StopLine(1, np.array([[48.0, 1.75], [47.5, -1.75]]), ((2, (50,)), (3, (51,))), turns_on_red=()),
        StopLine(4, np.array([[68.25, -6.0], [71.75, -6.0]]), has_stop_sign=True),
    )
    plain = world(junction(), cars=[Car(100, 20.0, velocity=4.0), Car(102, 70.0, -45.0, 3.0, 1.57)], problems=[ASKED])
    return replace(
        plain,
        traffic_lights=LIGHTS,
        stop_lines=lines,
        incomings=(Incoming(61, 60, (1,), (2, 3)), Incoming(62, 60, (4,), ())),
        priorities=Priorities(turns=((2, "straight"), (3, "left")), ranks=((1, (4, 5, 4)), (4, (1, 1, 1))), minor=(4,)),
        crosswalks=(2,),
    )


def assert_same(one: Any, other: Any, where: str = "scenario") -> None:
    if is_dataclass(one):
        assert type(one) is type(other), where
        aside = ("path", "sha256", "notes", "name", "light_ids")
        for name in (field.name for field in fields(one) if field.name not in aside):
            assert_same(getattr(one, name), getattr(other, name), f"{where}.{name}")
        if isinstance(one, StopLine):
            assert [way for way in one.light_ids if way[1]] == [way for way in other.light_ids if way[1]]
    elif isinstance(one, tuple):
        assert len(one) == len(other), where
        for index, (a, b) in enumerate(zip(one, other, strict=True)):
            assert_same(a, b, f"{where}[{index}]")
    else:
        np.testing.assert_array_equal(one, other, err_msg=where)


def again(scenario: Scenario, folder: Path) -> Scenario:
    idr.write_scenario(scenario, folder / "made.xml")
    return idr.read_scenario(folder / "made.xml")


def digest(scenario: Scenario) -> str:
    return idr.simulate(scenario, planner="idm", agents="problems").digest


WORLDS = {
    "everything": everything(),
    "no control": made(junction(), cars=[Car(100, 20.0)], problems=[ASKED]),
    "two lanes": world(straight_road(200.0, lanes=2), cars=[Car(11, 30.0, velocity=5.0, first=3, last=90)], steps=90),
    "one way above the other": world(
        replace(crossing(), heights=(np.linspace(0.1, 7.3, 41), np.zeros(0))), cars=[Car(9, -50.0, velocity=8.0)]
    ),
    "no traffic": world(straight_road(), problems=[ASKED]),
    "crossing with give way": replace(
        world(crossing(), cars=[Car(9, -50.0, velocity=8.0), Car(10, 0.0, -60.0, 8.0, np.pi / 2)]),
        priorities=Priorities(ranks=((1, (2, 2, 2)), (2, (4, 5, 4)))),
    ),
    "stop sign at the end of a lanelet": replace(
        everything(),
        stop_lines=(StopLine(4, np.array([[68.25, 50.0], [71.75, 50.0]]), has_stop_sign=True, is_stated=False),),
        traffic_lights=LIGHTS[1:2],
    ),
    "right on red beside a green arrow": replace(
        world(replace(junction(), left=tuple(b * (1, -1) for b in junction().right),
                      right=tuple(b * (1, -1) for b in junction().left)), problems=[ASKED]),
        traffic_lights=(TrafficLight(50, (("red", 400), ("green", 10))),),
        stop_lines=(StopLine(1, np.array([[48.0, 1.75], [48.0, -1.75]]), ((2, (50,)), (3, (50,))), turns_on_red=(3,)),),
        priorities=Priorities(turns=((2, "straight"), (3, "right")), minor=(4,)),
        incomings=(Incoming(61, 60, (1,), (2, 3)),),
    ),
    "a start with unknown yaw rate and a goal on lanelets": made(
        junction(),
        problems=[
            PlanningProblem(
                70,
                InitialState(2, 3.0, 0.1, 0.01, 7.3, float("nan")),
                (GoalState((), (), (10, 90), velocity=(0.0, 9.5), orientation=(-0.3, 0.3)),),
            )
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WORLDS)
def test_a_scenario_is_the_same_field_by_field_after_writing_and_reading(name: str, tmp_path: Path) -> None:
    scenario = WORLDS[name]
    read = again(scenario, tmp_path)
    recorded = slice(read.obstacles.n_steps)
    obstacles = scenario.obstacles
    cut = {
        name: getattr(obstacles, name)[:, recorded]
        for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid")
    }
    assert not obstacles.valid[:, read.obstacles.n_steps :].any()
    assert_same(replace(scenario, obstacles=replace(obstacles, **cut)), read)


@pytest.mark.parametrize("name", ["everything", "no control", "right on red beside a green arrow"])
def test_agents_drive_the_same_after_writing_and_reading(name: str, tmp_path: Path) -> None:
    assert digest(again(WORLDS[name], tmp_path)) == digest(WORLDS[name])


def test_scenarios_with_random_control_are_the_same_after_writing_and_reading(tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    colours = ("green", "yellow", "red", "dark")
    for index in range(12):
        phases = tuple((colours[random.integers(3)], int(random.integers(1, 60))) for _ in range(random.integers(1, 6)))
        light = TrafficLight(80, phases, int(random.integers(0, 30)), frozenset(("left", "straight", "right")))
        ends = np.array([[45.0, 1.75], [45.0, -1.75]]) + random.uniform(-1.0, 1.0, (2, 2))
        ways = tuple((way, (80,)) for way in (2, 3))
        stops = bool(random.integers(2))
        ranks = ((1, (1, 1, 1)),) if stops else ((1, ((2, 2, 2), (4, 5, 4))[random.integers(2)]),)
        scenario = replace(
            world(junction(), cars=[Car(100, random.uniform(5.0, 40.0), velocity=random.uniform(0.0, 9.0))]),
            traffic_lights=(light,),
            stop_lines=(StopLine(1, ends, ways, stops),),
            priorities=Priorities(ranks=ranks, minor=(4,)),
            crosswalks=((), (2,), (2, 3))[random.integers(3)],
        )
        idr.write_scenario(scenario, tmp_path / f"{index}.xml")
        assert_same(scenario, idr.read_scenario(tmp_path / f"{index}.xml"))


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"priorities": Priorities(left_hand=True, minor=(4,))}, "left_hand"),
        ({"priorities": Priorities(minor=(2,))}, "minor"),
        ({"stop_lines": (StopLine(1, np.array([[48.0, 1.75], [48.0, -1.75]])),)}, "stop_lines"),
        ({"traffic_lights": (TrafficLight(100, (("red", 5),), position=(0.0, 0.0)),)}, "obstacles"),
        ({"traffic_lights": (TrafficLight(90, (("red", -5), ("green", 3)), position=(0.0, 0.0)),)}, "traffic_lights"),
        ({"incomings": (Incoming(61, 60, (1,), (2, 3)),)}, "turns"),
        ({"crosswalks": (77,)}, "crosswalks"),
        # No sign has these ranks.
        ({"priorities": Priorities(ranks=((1, (3, 4, 3)),))}, "ranks"),
        ({"planning_problems": (problem(100, 5.0, goal=(90.0, 0.0), time_step=(0, 150)),)}, "planning_problems"),
    ],
)
def test_what_a_file_cannot_hold_is_refused_in_one_line(changed: dict[str, Any], named: str, tmp_path: Path) -> None:
    scenario = made(junction(), cars=[Car(100, 20.0)])
    with pytest.raises(InputError, match=named) as refused:
        idr.write_scenario(replace(scenario, **changed), tmp_path / "made.xml")
    assert "\n" not in str(refused.value)
    assert not list(tmp_path.iterdir())


def test_no_file_is_replaced_unasked_and_none_that_is_read(tmp_path: Path) -> None:
    read = again(WORLDS["no control"], tmp_path)
    with pytest.raises(InputError, match=r"made\.xml: exists"):
        idr.write_scenario(WORLDS["everything"], tmp_path / "made.xml")
    with pytest.raises(idr.ResultsError, match="which is read"):
        idr.write_scenario(read, tmp_path / "made.xml", overwrite=True)
    idr.write_scenario(WORLDS["everything"], tmp_path / "made.xml", overwrite=True)
    assert idr.read_scenario(tmp_path / "made.xml").traffic_lights == LIGHTS


def test_a_saved_run_keeps_lights_lines_signs_and_intersections_of_a_scenario_without_file(tmp_path: Path) -> None:
    scenario = everything()
    run = idr.simulate(scenario, planner="idm", agents="problems")
    loaded = idr.load(run.save(tmp_path / "run")).scenario
    for name in ("lanelets", "traffic_lights", "stop_lines", "priorities", "crosswalks", "incomings"):
        assert_same(getattr(scenario, name), getattr(loaded, name), name)


def test_a_saved_run_says_what_its_scenario_file_lacks(tmp_path: Path) -> None:
    scenario = replace(WORLDS["no control"], priorities=Priorities(minor=(4,), priority_side="left"))
    run = idr.simulate(scenario, planner="idm", agents="problems")
    notes = idr.load(run.save(tmp_path / "run")).notes
    assert any("scenario.xml lacks priorities.priority_side" in note for note in notes)
