"""What agents see: line of sight, what it keeps from planners, and the record of what was seen."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from drivers import Straight

from interdrive import Simulation, SimulationSettings, ViewSettings, save, simulate
from interdrive.config.binding import bind
from interdrive.results import read_results
from interdrive.scenario import Shape
from interdrive.testing import Car, crossing, problem, straight_road, world

WALL, AGENT, OTHER = 50, 100, 7


def corner(wall=True, other=True):
    """The agent drives towards a crossing; a building at the corner hides traffic from the right."""
    cars = [Car(OTHER, 0.0, -30.0, velocity=12.0, orientation=np.pi / 2)] * other + [Car(WALL, -20.0, -20.0)] * wall
    problems = [problem(AGENT, -30.0, velocity=12.0, goal=(60.0, 0.0), time_step=(0, 100))]
    scenario = world(crossing(), cars=cars, problems=problems)
    building = scenario.obstacles.ids == WALL
    obstacles = replace(
        scenario.obstacles,
        kinds=tuple("structure" if is_one else "car" for is_one in building),
        shapes=tuple(
            Shape("rectangle", length=30.0, width=30.0) if is_one else Shape("rectangle", length=4.5, width=1.8)
            for is_one in building
        ),
        is_static=building,
    )
    return replace(scenario, obstacles=obstacles)


def settings(**values):
    return bind(SimulationSettings(), {name.replace("__", "."): value for name, value in values.items()})


class Looking(Straight):
    """Remembers which participants it saw and for which it got predictions."""

    def __init__(self):
        self.seen, self.predicted = {}, {}

    def plan(self, view, predictions):
        self.seen[view.time_step] = view.ids.tolist()
        self.predicted[view.time_step] = predictions.ids.tolist()
        return super().plan(view, predictions)


def test_who_is_hidden_at_the_corner_is_neither_seen_nor_predicted_until_it_appears():
    looking = Looking()
    simulate(
        corner(), agents=[AGENT], planner={AGENT: lambda: looking}, settings=settings(view__occlusion="true"), threads=1
    )
    assert looking.seen[0] == [WALL]
    assert looking.predicted[0] == [WALL, AGENT]
    appears = next(step for step, seen in looking.seen.items() if OTHER in seen)
    assert appears == expected_appearance()
    assert looking.predicted[appears] == [OTHER, WALL, AGENT]


def expected_appearance():
    """The first step at which the line from the agent's centre to a front corner of the other car, 2.25 m ahead of its
    centre and 0.9 m aside, passes the building's corner (-5, -5) on the side of the crossing.
    """
    for step in range(100):
        eye = np.array([-30.0 + 1.2 * step, 0.0])
        for target in ([-0.9, -30.0 + 1.2 * step + 2.25], [0.9, -30.0 + 1.2 * step + 2.25]):
            along, corner_from_eye = np.array(target) - eye, np.array([-5.0, -5.0]) - eye
            if along[0] * corner_from_eye[1] - along[1] * corner_from_eye[0] < 0:
                return step
    raise AssertionError


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_a_native_planner_plans_as_if_the_hidden_car_were_not_there(planner):
    def first_plan(scenario, **values):
        plans = simulate(scenario, agents=[AGENT], planner=planner, settings=settings(**values), threads=1).plans
        return plans.x[0]

    hidden = first_plan(corner(), view__occlusion="true", rules__unseen="false")
    assert np.array_equal(hidden, first_plan(corner(other=False)))
    if planner == "rollout":
        assert not np.array_equal(hidden, first_plan(corner()))
    careful = first_plan(corner(), view__occlusion="true")
    assert np.array_equal(careful, first_plan(corner(other=False), view__occlusion="true"))


def test_without_the_building_line_of_sight_changes_nothing():
    seen_through_air, seen_anyway = (
        simulate(corner(wall=False), agents=[AGENT], settings=settings(view__occlusion=value), threads=1).digest
        for value in ("true", "false")
    )
    assert seen_through_air == seen_anyway


def test_one_agent_may_see_through_what_hides_others_from_another():
    views = {AGENT: ViewSettings(occlusion=True), OTHER: ViewSettings(occlusion=False)}
    run = simulate(
        corner(),
        agents=[AGENT, OTHER],
        planner=Straight,
        views=views,
        settings=settings(record__views="true"),
        threads=1,
    )
    assert run.views.seen_by(AGENT, 0) == [WALL]
    assert run.views.seen_by(OTHER, 0) == [WALL, AGENT]
    assert run.settings["views"] == {str(AGENT): asdict(ViewSettings(occlusion=True))}


def test_the_record_of_views_is_what_planners_were_shown():
    looking = Looking()
    cars = [
        Car(7, 60.0, velocity=3.0),
        Car(9, 30.0, 3.5, velocity=25.0),
        Car(11, 20.0, 3.5, velocity=15.0, first=20, last=40),
    ]
    problems = [problem(AGENT, 20.0, goal=(120.0, 0.0), velocity=8.0, time_step=(0, 90))]
    run = simulate(
        world(straight_road(400.0, lanes=2), cars=cars, problems=problems),
        agents=[AGENT],
        planner={AGENT: lambda: looking},
        settings=settings(record__views="true", view__sensor_radius="38", view__occlusion="true"),
        threads=1,
    )
    assert {step: run.views.seen_by(AGENT, step) for step in looking.seen} == looking.seen
    assert run.views.observer_id.tolist() == sorted(run.views.observer_id.tolist())
    assert (run.views.first_time_step <= run.views.last_time_step).all()
    # Uninterrupted visibility is one interval, not one per step.
    assert len(run.views.seen_id) < 8


def test_the_record_of_views_is_saved_and_read_again(tmp_path):
    run = simulate(corner(), agents=[AGENT], settings=settings(record__views="true"), threads=1)
    read = read_results(save(run, tmp_path / "made"))
    assert read.info["views"] == "views.parquet"
    assert read.views.column_names == ["observer_id", "seen_id", "first_time_step", "last_time_step"]
    assert read.views.column("seen_id").to_pylist() == run.views.seen_id.tolist()
    assert read.views.num_rows > 0


def test_views_are_recorded_only_when_asked(tmp_path):
    run = simulate(corner(), agents=[AGENT], threads=1)
    assert run.views is None
    read = read_results(save(run, tmp_path / "made"))
    assert read.views is None
    assert not (tmp_path / "made" / "views.parquet").exists()


@pytest.mark.parametrize("change", [{"threads": 2}, {"agents": [OTHER, AGENT]}])
def test_line_of_sight_does_not_depend_on_threads_or_order(change):
    options = {"agents": [AGENT, OTHER], "threads": 1, "settings": settings(view__occlusion="true")}
    assert simulate(corner(), **options).digest == simulate(corner(), **(options | change)).digest


def test_recording_views_does_not_change_the_run():
    digests = {
        simulate(corner(), settings=settings(record__views=value, view__occlusion="true"), threads=1).digest
        for value in ("true", "false")
    }
    assert len(digests) == 1


def test_in_dense_traffic_line_of_sight_hides_some_and_shows_nobody_else(scenarios_folder):
    path = next(scenarios_folder.glob("*/USA_US101-23_1_T-1.xml"))

    def seen(occlusion):
        simulation = Simulation(
            path, agents=24, settings=settings(record__views="true", view__occlusion=occlusion), threads=1
        )
        simulation.step()
        run = simulation.record()
        return {observer: set(run.views.seen_by(observer, 0)) for observer in run.views.observer_id.tolist()}

    near, in_sight = seen("false"), seen("true")
    assert in_sight.keys() == near.keys()
    assert all(in_sight[observer] <= near[observer] for observer in near)
    share = sum(map(len, in_sight.values())) / sum(map(len, near.values()))
    assert 0.3 < share < 0.9
