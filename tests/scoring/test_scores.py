"""Scores of whole runs in tiny worlds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive import _core
from interdrive.results import read_results, save
from interdrive.results.story import story
from interdrive.scoring import save_score, stored_score
from interdrive.scoring.faults import FAULT_KINDS
from interdrive.scoring.hindrance import FORCED_DECELERATION
from interdrive.testing.worlds import Car, problem, straight_road, world


class Stand:
    """Brakes at 2 m/s² and stands."""

    def plan(self, view, predictions):
        speed = np.maximum(view.ego.velocity - 0.2 * np.arange(31), 0.0)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * view.dt)])
        x = view.ego.x + way * math.cos(view.ego.orientation)
        y = view.ego.y + way * math.sin(view.ego.orientation)
        return idr.Trajectory(x, y, np.full(31, view.ego.orientation), speed)


class Straight:
    """Keeps speed and heading, whatever comes."""

    def plan(self, view, predictions):
        way = view.ego.velocity * view.dt * np.arange(31)
        x = view.ego.x + way * math.cos(view.ego.orientation)
        y = view.ego.y + way * math.sin(view.ego.orientation)
        return idr.Trajectory(x, y, np.full(31, view.ego.orientation), np.full(31, view.ego.velocity))


def follow(lead, planner):
    """Agent 1 at 12 m/s behind a lead car, in a lane of 300 m."""
    cars = (Car(1, x=10.0, velocity=12.0), lead)
    return idr.simulate(world(straight_road(300.0), cars=cars, steps=80), agents=[1], planner=planner)


@pytest.fixture(scope="module")
def collided():
    return follow(Car(2, x=70.0, velocity=0.0), Straight)


def test_the_recording_itself_gets_everything():
    found = idr.score(follow(Car(2, x=60.0, velocity=12.0), "recorded"), panel="none")
    assert (found.score[0], found.score_1[0], found.excused[0]) == (1.0, 1.0, ())
    assert found.terms["gate_speed"][0] == 1.0, "no lanelet states a limit"
    assert found.why(1) == "full score"


def test_a_vehicle_is_forced_by_braking_harder_than_the_rules_expect_of_others():
    # If what is expected changes, decide whether scores follow, which makes those of before incomparable.
    assert FORCED_DECELERATION == _core.EXPECTED_DECELERATION


def test_who_stands_where_free_flow_drives_has_the_share_of_its_time():
    found = idr.score(follow(Car(2, x=60.0, velocity=12.0), Stand), panel="none")
    way, free, duration = (found.terms[name][0] for name in ("way", "free_flow", "duration"))
    assert way == pytest.approx(12.0**2 / 4.0, abs=0.7), "m"
    assert found.terms["pace"][0] == pytest.approx(free / duration)
    assert found.score[0] == pytest.approx(found.terms["pace"][0])
    assert found.score[0] < 0.5 < found.score_1[0]


def test_driving_into_a_standing_car_is_its_fault_and_the_score_says_so(collided):
    found = idr.score(collided, panel="none")
    assert (found.score[0], found.fault[0], found.fault_kind[0]) == (0.0, True, "ran_into")
    assert found.terms["room"][0] == pytest.approx(55.5 - 15.0, abs=0.01)
    assert found.why(1).startswith(
        "at fault: ran into 2, which was in its way at 0.0 s with 55.5 m left, 15.0 m needed"
    )
    assert found.score_1[0] == 0.0
    assert "time to contact straight on 0: " in found.why(1)


def test_a_standing_thing_counts_half(collided):
    kinds = tuple("structure" if n == 2 else k for n, k in zip((1, 2), collided.states.kinds, strict=True))
    thing = replace(collided, states=replace(collided.states, kinds=kinds))
    found = idr.score(thing, panel="none")
    assert found.terms["gate_fault"][0] == 0.5
    assert 0.0 < found.score_1[0] <= 0.5
    assert "(counts half)" in found.why(1)


def test_time_to_contact_straight_on_and_time_to_collision_along_lanes_are_told_apart():
    agent = problem(1, 30.0, velocity=10.0, goal=(180.0, 0.0), time_step=(0, 200))
    scenario = world(straight_road(300.0), cars=[Car(7, 38.0, velocity=0.5)], problems=[agent], steps=60)
    run = idr.simulate(scenario, agents=[1], planner=Straight, threads=1)
    found = idr.score(run, panel="none")
    told = "; ".join(found.reasons[0]) + " ".join(story(run, 1))
    assert "time to contact straight on 0: " in told
    assert "least time to collision along lanes" in told
    assert "time to collision " not in told.replace("time to collision along lanes", "")
    assert "TTC" not in told


def test_an_agent_whose_planner_broke_gets_nothing(collided):
    ended = collided.outcomes
    broken = replace(collided, outcomes=replace(ended, outcome=("planner_error",), partner_id=np.array([-1])))
    found = idr.score(broken, panel="none")
    assert (found.score[0], found.score_1[0], found.why(1)[:13]) == (0.0, 0.0, "planner_error")


def test_without_a_recording_progress_in_score_1_is_the_way_to_the_goal_in_its_time():
    goal = problem(1, 10.0, velocity=8.0, goal=(110.0, 0.0), time_step=(0, 100))
    run = idr.simulate(world(straight_road(300.0), problems=[goal], steps=50), agents=[1], planner=Straight)
    late = replace(run, outcomes=replace(run.outcomes, outcome=("time_limit",)))
    # 95 m to the goal in at most 10 s; it drives 8 m/s until the run ends.
    seconds = (run.states.n_steps - 2) * 0.1
    progress = min(1.0, (8.0 * seconds) / (94.2 * min(1.0, (seconds + 0.1) / 10.0)))
    # Progress, time to contact straight on and comfort, no limit: 5, 5 and 2 of 12.
    expected = (5.0 * progress + 7.0) / 12.0
    assert idr.score(late, panel="none").score_1[0] == pytest.approx(expected, abs=0.01)


def test_a_red_light_decides_at_a_crossing_whose_fault_it_is(collided):
    from interdrive.run import Violations
    from interdrive.scoring.faults import Verdict, _at_crossing

    def broken(number, rule="red_light", partner=-1):
        return Violations(
            ("agent",), np.array([number]), (rule,), *(np.array([at]) for at in (20, 20, 1, partner)),
            *(np.zeros(1) for _ in range(3)),
        )  # fmt: skip

    came_late = Verdict("cut_off", -3.0, "lateral", False, 3.97, 40, "cut off 2")
    assert _at_crossing(came_late, broken(2), 1, 2, 0.1, 10.0).kind == ""
    found = _at_crossing(replace(came_late, kind=""), broken(1), 1, 2, 0.1, 10.0)
    assert (found.kind, found.words) == ("red_light", "passed a red light 2.0 s before the contact with 2")
    assert _at_crossing(came_late, broken(2), 1, 2, 0.1, 1.0).kind == "cut_off", "too long ago"
    assert _at_crossing(came_late, broken(2, "right_of_way", 1), 1, 2, 0.1, 10.0).kind == ""
    assert _at_crossing(came_late, broken(2, "right_of_way", 3), 1, 2, 0.1, 10.0).kind == "cut_off", "that of another"


def test_scores_do_not_depend_on_the_order_of_agents_and_are_written_with_equal_bytes(tmp_path):
    first, second = (idr.simulate("t_junction", agents=ids) for ids in ([1003, 1005, 1001], [1001, 1003, 1005]))
    found, other = idr.score(first), idr.score(second, [1005, 1003, 1001])
    assert found.ids.tolist() == [1001, 1003, 1005]
    folder = save(first, tmp_path / "run")
    content = [save_score(one, folder).read_bytes() for one in (found, other)]
    assert content[0] == content[1]
    again = idr.load(folder)
    assert save_score(idr.score(again), folder).read_bytes() == content[0]
    assert stored_score(folder).column_names[:2] == ["agent_id", "score"]
    assert set(stored_score(folder)["fault_kind"].to_pylist()) <= {"", *FAULT_KINDS}
    read_results(folder)  # the folder stays a run


def test_an_agent_that_is_not_there_is_refused(collided):
    with pytest.raises(idr.InputError, match="7 is not an agent of this run"):
        idr.score(collided, [7])
