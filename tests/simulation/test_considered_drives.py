"""What a view answers about a drive that a planner considers."""

import numpy as np
import pytest

import interdrive as idr
from interdrive.testing import Car, problem, straight_road, world

AGENT = 100
STEPS = np.arange(31) * 0.1


@pytest.fixture(scope="module")
def seen():
    """A view of a lane 3.5 m wide with a car (4.5 m by 1.8 m) standing 40 m ahead of the agent, and the predictions."""
    asked = problem(AGENT, 20.0, velocity=10.0, goal=(150.0, 0.0), time_step=(10, 100))
    scenario = world(straight_road(200.0), cars=[Car(1, 60.0)], problems=[asked])
    simulation = idr.Simulation(scenario, agents=[AGENT], threads=1)
    scene = simulation.world.scene()
    return simulation.world.view(scene, AGENT), simulation.progress.predict(scene)


def drive(velocity: float, y: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return 20.0 + velocity * STEPS, np.zeros(31) + y, np.zeros(31)


def test_a_drive_along_the_lane_stays_on_the_road_and_one_across_its_edge_does_not(seen):
    view, _ = seen
    assert view.on_road(*drive(10.0))
    assert not view.on_road(*drive(10.0, y=np.linspace(0.0, 1.5, 31)))


@pytest.mark.parametrize(
    ("velocity", "margin", "expected"),
    [
        (10.0, 0.0, None),  # gets 30 m of the 40 m less 4.5 m
        (12.0, 0.0, (1, 29)),  # 35.5 m are covered after 2.958 s
        (10.0, 12.0, (1, 29)),  # half of the margin is in front of the car: 29.5 m
        (20.0, 0.0, (1, 17)),  # 1.775 s
    ],
)
def test_the_first_contact_is_in_the_interval_in_which_the_gap_is_used_up(seen, velocity, margin, expected):
    view, predictions = seen
    assert AGENT in predictions.ids.tolist()  # which is not in its own way
    assert view.first_contact(*drive(velocity), predictions, margin) == expected


def test_a_drive_needs_arrays_of_one_length(seen):
    view, predictions = seen
    x, y, orientation = drive(10.0)
    with pytest.raises(idr.InputError, match="y: 30 values given, 31 expected"):
        view.on_road(x, y[:30], orientation)
    with pytest.raises(idr.InputError, match="orientation: 1 values given, 31 expected"):
        view.first_contact(x, y, orientation[:1], predictions)


def test_a_goal_can_be_read(seen):
    view, _ = seen
    ((areas, time_step, velocity, orientation),) = view.ego.goal.states
    assert time_step == (10, 100)
    assert velocity is None
    assert orientation is None
    (area,) = areas
    assert area.min(axis=0).tolist() == [145.0, -1.75]
    assert area.max(axis=0).tolist() == [155.0, 1.75]
