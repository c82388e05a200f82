"""How agents drive beside their recordings: measures of invented drives, computed by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario import StopLine, TrafficLight
from interdrive.simulation import Simulation
from interdrive.testing import Car, crossing, problem, straight_road, world

if not (Path(__file__).resolve().parents[2] / "benchmarks" / "driving").is_dir():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)

DT = 0.1


class Stands:
    """Does not move."""

    def plan(self, view, predictions):
        ego, same = view.ego, np.ones(31)
        return idr.Trajectory(ego.x * same, ego.y * same, ego.orientation * same, 0.0 * same)


def driven(pace, steps=100):
    """A recorded car at 10 m/s that, as an agent, drives 10 m/s times `pace`; with its route and its road."""
    simulation = Simulation(world(straight_road(300.0), cars=[Car(1, 20.0, velocity=10.0)]), planner="recorded")
    run = simulation.run()
    x = 20.0 + 10.0 * pace * DT * np.arange(run.states.n_steps)[None, :]
    return replace(run, states=replace(run.states, x=x)), 0, simulation.agents[0].route, simulation.road


def drive(velocity, orientation=None):
    """A run of one agent with these speeds and headings."""
    run, *_ = driven(1.0)
    n = run.states.n_steps
    heading = np.zeros(n) if orientation is None else orientation[:n]
    return replace(run.states, velocity=velocity[None, :n], orientation=heading[None, :])


@pytest.mark.parametrize(
    ("bound", "speed", "metres", "seconds"),
    [
        ([10.0] * 401, 10.0, 100, 10.0),
        ([50 / 3.6] * 401, 0.0, 100, 10.672245377),  # 6.94 s and 48.2 m of 2 m/s², then 51.8 m at 13.9 m/s.
        ([20.0] * 120 + [10.0] * 281, 20.0, 100, 7.833333333),  # Brakes from 10 m before the limit to 60 m on.
        ([10.0] * 401, 20.0, 100, 8.333333333),  # Too fast at first: 50 m with 3 m/s², in 3.33 s.
    ],
)
def test_free_flow_accelerates_and_brakes_comfortably_between_limits(part, bound, speed, metres, seconds):
    pace = part("pace")
    times = pace.free_flow(np.array(bound), speed)
    assert np.interp(metres, pace.SPACING * np.arange(len(times)), times) == pytest.approx(seconds, abs=1e-6)


def test_an_agent_as_fast_as_its_recording_has_the_pace_of_its_recording(part):
    own, recorded = part("pace").paces(*driven(1.0))
    assert own == pytest.approx(recorded)
    # 100 m from 10 m/s on, up to 15 m/s with 2 m/s²: 2.5 s for 31.25 m, 68.75 m at 15 m/s; the last 0.5 m are forgiven.
    assert recorded == pytest.approx((2.5 + 68.25 / 15.0) / 9.9, abs=0.02)


@pytest.mark.parametrize(("pace", "slow"), [(0.7, 1.0), (0.9, 0.0), (0.0, 1.0)])
def test_an_agent_is_slow_below_four_fifths_of_its_recording(part, row, pace, slow):
    own, recorded = part("pace").paces(*driven(pace))
    assert own == pytest.approx(pace * recorded, abs=0.05)
    assert part("measures").MANNER[0].of(row(1, pace=own, recorded_pace=recorded)) == slow


def test_a_recording_of_nine_metres_says_nothing_about_pace(part):
    run, *rest = driven(1.0)
    obstacles = run.scenario.obstacles
    short = replace(obstacles, valid=obstacles.valid & (np.arange(101) < 10))
    cut = replace(run, scenario=replace(run.scenario, obstacles=short))
    assert np.isnan(part("pace").paces(cut, *rest)).all()


def test_a_planning_problem_is_held_against_free_flow(part):
    scenario = world(straight_road(), problems=[problem(1, 20.0, velocity=0.0, goal=(100.0, 0.0), time_step=(0, 100))])
    simulation = Simulation(scenario, planner=Stands, threads=1)
    own = part("pace").paces(simulation.run(), 0, simulation.agents[0].route, simulation.road)
    assert own == (0.0, 1.0)


def test_the_hardest_braking_counts_from_a_second_and_a_half_on(part):
    speed = np.full(101, 20.0)
    speed[:10] = 20.0 + 8.0 * DT * np.arange(10, 0, -1)  # 8 m/s² at once.
    speed[30:41] -= 4.0 * DT * np.arange(11)
    speed[41:] = speed[40]
    found = part("comfort").extremes(drive(speed), 0, DT)
    assert found.brake == pytest.approx(4.0)
    assert found.across == 0.0
    assert found.jerk == pytest.approx(8.0)  # From 0 to 4 m/s² within half a second.


def test_acceleration_across_is_speed_times_change_of_heading(part):
    found = part("comfort").extremes(drive(np.full(101, 10.0), 0.35 * DT * np.arange(101)), 0, DT)
    assert found.across == pytest.approx(3.5)
    assert found.brake == pytest.approx(0.0)


def test_a_vehicle_that_starts_to_reverse_does_not_brake_and_one_that_then_stops_does(part):
    speed = -np.minimum(4.0, 8.0 * DT * np.maximum(np.arange(101) - 30, 0))
    assert part("comfort").extremes(drive(speed), 0, DT).brake == pytest.approx(0.0)
    assert part("comfort").extremes(drive(speed[::-1].copy()), 0, DT).brake == pytest.approx(8.0)


def test_a_drive_of_two_seconds_has_no_comfort(part):
    states = drive(np.full(101, 10.0))
    short = replace(states, valid=states.valid & (np.arange(states.n_steps) < 21))
    assert np.isnan(part("comfort").extremes(short, 0, DT)).all()


def standing(part, lanelets, *cars, lights=()):
    """For how long an agent that stands with its front at x = 32.25 m has a free way [s], of 12 s."""
    agent = problem(1, 30.0, velocity=0.0, goal=(90.0, 0.0), time_step=(0, 120))
    scenario = world(lanelets, cars=cars, problems=[agent], steps=120)
    if lights:
        line = StopLine(1, np.array([[40.0, 1.75], [40.0, -1.75]]), ((1, (7,)),))
        scenario = replace(scenario, stop_lines=(line,), traffic_lights=(TrafficLight(7, lights),))
    simulation = Simulation(scenario, agents=[1], planner=Stands, settings={"step.standstill_s": 1000.0}, threads=1)
    run = simulation.run()
    row = int(np.searchsorted(run.states.participant_id, 1))
    steps = np.arange(121)
    is_free = part("free_way").free(run, row, simulation.agents[0].route, steps)
    return part("drives").longest(is_free, DT)


@pytest.mark.parametrize(
    ("cars", "seconds"),
    [
        ([], 12.1),
        ([Car(2, 50.0)], 0.0),  # 15.5 m ahead of the front.
        ([Car(2, 60.0)], 12.1),
        ([Car(2, 45.0, 3.5)], 12.1),  # In the lane beside.
        ([Car(2, 10.0)], 12.1),  # Behind.
    ],
)
def test_a_way_is_free_if_nothing_stands_on_the_next_twenty_metres(part, cars, seconds):
    assert standing(part, straight_road(lanes=2), *cars) == pytest.approx(seconds)


def test_crossing_traffic_takes_the_way_while_it_crosses(part):
    lanelets = crossing()
    agent = problem(1, -15.0, velocity=0.0, goal=(60.0, 0.0), time_step=(0, 120))
    # Its body of 4.5 m passes the 2 m of the agent's way at 5 m/s between 4.8 and 6.4 s.
    car = Car(2, 0.0, -28.0, velocity=5.0, orientation=0.5 * np.pi)
    simulation = Simulation(world(lanelets, cars=[car], problems=[agent], steps=120), agents=[1], planner=Stands)
    run = simulation.run()
    is_free = part("free_way").free(run, 0, simulation.agents[0].route, np.arange(100))
    (taken,) = np.nonzero(~is_free)
    assert 44 <= taken[0] <= 50
    assert 62 <= taken[-1] <= 68
    assert not is_free[taken[0] : taken[-1]].any()


def test_a_red_light_takes_the_way_until_it_is_green(part):
    assert standing(part, straight_road(), lights=(("red", 40), ("green", 1000))) == pytest.approx(8.1)


def test_agents_that_are_linked_by_others_fail_in_one_event(part):
    queue = [(2, 1), (3, 2), (4, 3), (8, 7)]
    assert part("events").joined(queue, {2, 4, 7, 8, 9}) == {2: 2, 4: 2, 7: 7, 8: 7, 9: 9}
    assert part("events").joined([], {5}) == {5: 5}


def test_a_queue_behind_a_car_that_stands_is_one_event_and_a_collision_elsewhere_another(part):
    goal = {"goal": (190.0, 0.0), "time_step": (0, 100)}
    agents = [problem(i, x, velocity=8.0, **goal) for i, x in ((1, 80.0), (2, 65.0), (3, 50.0))]
    scenario = world(straight_road(), cars=[Car(9, 120.0)], problems=agents)
    simulation = Simulation(scenario, agents=[1, 2, 3], planner="idm", threads=1)
    run = simulation.run()
    routes = [agent.route for agent in simulation.agents]
    delays = {agent.id: part("causes").Delay.of(run, i, routes[i]) for i, agent in enumerate(run.agents)}
    assert set(run.outcomes.outcome) == {"time_limit"}
    assert part("events").events(run, routes, delays, {1, 2, 3}) == {1: 1, 2: 1, 3: 1}
    assert part("events").events(run, routes, delays, set()) == {}


def test_an_interval_is_taken_over_places_and_repeats(part):
    measures = part("measures")
    of = np.repeat(np.arange(6), 10)
    values = np.where(of == 0, 1.0, 0.0)  # All ten agents of one place.
    low, high = measures.interval([values], of, None)
    assert (low, high) == measures.interval([values], of, None)
    assert low == 0.0
    assert high == pytest.approx(0.5)  # Drawn three times in six; as single agents it would be 0.28.
    assert np.isnan(measures.interval([values, values], of, None)).all()  # No change, in whatever sample.
    assert np.isnan(measures.interval([values[:40]], of[:40], None)).all()  # Four places.


def test_means_and_quantiles_count_agents_as_often_as_their_place_was_drawn(part):
    statistic = part("measures").statistic
    values, weights = np.array([3.0, 1.0, 2.0]), np.array([[1.0, 1.0, 0.0], [0.0, 3.0, 7.0], [0.0, 0.0, 0.0]])
    assert statistic(values, weights, None) == pytest.approx([2.0, 1.7, np.nan], nan_ok=True)
    assert statistic(values, weights, 0.3) == pytest.approx([1.0, 1.0, np.nan], nan_ok=True)
    assert statistic(values, weights, 0.5) == pytest.approx([1.0, 2.0, np.nan], nan_ok=True)


def test_files_are_resampled_where_there_are_few_places(part, row):
    units = part("measures").units
    assert units([row(i, place=f"P{i}") for i in range(5)])[0] == "places"
    what, of = units([row(i, place="P", scenario=f"S{i // 2}") for i in range(6)])
    assert what == "files"
    assert of.tolist() == [0, 0, 1, 1, 2, 2]


def test_recorded_people_stand_below_the_agents(part, row):
    rough = {"brake": 3.5, "across": 4.0, "jerk": 6.0, "pace": 0.7, "recorded_pace": 0.9, "violations": 2}
    drives = [row(1, **rough, category="urban"), row(2, recorded_brake=3.1, recorded_violations=1, category="urban")]
    drives.append(row(3, brake=9.0, recorded_brake=float("nan"), stands_at_end=True, category="highway"))
    lines = part("tables").manner(drives).splitlines()
    assert lines[2:4] == [
        "| highway | 1 | 0.0 % |  | 0.0 % | 0.00 | 0.00 | 100.0 % | 0.0 |",
        "| urban | 2 | 50.0 % | 50.0 % | 50.0 % | 3.60 | 5.40 | 0.0 % | 100.0 |",
    ]
    assert lines[-1] == "| recorded people | 3 |  | 50.0 % | 0.0 % | 0.00 | 0.00 |  | 33.3 |"


def test_planning_problems_are_counted_apart_as_free_flow_knows_no_traffic(part, row):
    drives = [row(1, pace=0.5, recorded_pace=1.0, origin="planning problem"), row(2, pace=0.5, recorded_pace=0.5)]
    assert [part("measures").MANNER[0].of(one) for one in drives] == pytest.approx([np.nan, 0.0], nan_ok=True)
    assert part("tables").slow_problems(drives) == "1 of 1 planning problems are slower than 0.8 of free flow"


def test_the_same_agents_are_compared_measure_by_measure(part, row):
    old = [row(i, scenario="S", place=f"P{i}", across=2.0) for i in range(6)]
    new = [replace(one, across=4.0) if one.agent_id < 3 else one for one in old]
    new[5] = replace(new[5], outcome="collision", event=5)
    lines = part("tables").changes(old, [*new, row(9, scenario="T")]).splitlines()
    assert lines[2] == "|  | 6 | 6 | 5 | 0 | 1 | 0 | 1 | 0 | 0 |"
    table = {line.split(" | ")[0]: line for line in lines}
    assert table["| across > 3 m/s²"].startswith(
        "| across > 3 m/s² | 6 | 0.0 % | 50.0 % | +50.0 % | +16.7 % to +83.3 %"
    )
    assert table["| across > 3 m/s²"].endswith("| 3 | 0 |")
    assert table["| in time"].endswith("| 0 | 1 |")
    assert table["| events with collisions"] == "| events with collisions | 6 | 0 | 1 | +1 | | | |"


def test_agents_in_time_never_stand_without_collisions_and_violations(part, row):
    tables, drives = part("tables"), [row(1, place="P", category="urban")]
    for text in (tables.shares(drives), tables.halves(drives, {"P": "A"}), tables.changes(drives, drives)):
        heading = text.splitlines()[0]
        assert "in time" in heading
        assert "violations" in heading
        assert "collisions" in heading or "ran into agents" in heading


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("USA_US101-3_1_T-1", "US 101, Los Angeles"),
        ("C-DEU_MONAEast-2_1840_T-1919", "DEU_MONAEast-2"),
        ("t_junction", "t_junction"),
    ],
)
def test_a_file_shows_the_place_of_the_split_or_the_map_that_its_name_states(part, name, place):
    places = part("places")
    assert places.place_of(Path(f"{name}.xml"), places.places()) == place


@pytest.mark.parametrize(("folder", "category"), [("urban", "urban"), ("all", "files")])
def test_files_of_a_folder_called_all_are_not_counted_twice(part, folder, category):
    assert part("places").category_of(Path(folder) / "USA_US101-1_1_T-1.xml") == category


def aside(part, begin, seconds, side=1.0):
    """States of a car at 15 m/s that crosses from one of two lanes to the other at a constant speed, and the lanes."""
    start = 0.0 if side > 0.0 else 3.5
    scenario = world(straight_road(400.0, lanes=2), cars=[Car(1, 20.0, start, velocity=15.0)])
    run = Simulation(scenario, planner="recorded").run()
    time = DT * np.arange(run.states.n_steps)
    y = start + side * np.clip((time - begin) / seconds, 0.0, 1.0) * 3.5
    lanes = part("lane_changes").Lanes(Simulation(scenario).road, scenario.lanelets)
    return replace(run, states=replace(run.states, y=y[None, :])), lanes


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("seconds", [2.0, 3.5, 5.0])
def test_a_lane_change_lasts_while_the_vehicle_moves_aside(part, side, seconds):
    run, lanes = aside(part, 2.0, seconds, side)
    [(change, found)] = part("lane_changes").lane_changes(run.states, 0, lanes, DT)
    assert found == side
    assert change.seconds == pytest.approx(seconds, abs=0.5), "s, smoothed over 0.5 s"
    assert change.begin * DT == pytest.approx(2.0, abs=0.3)


def test_a_lane_change_that_the_drive_shows_in_part_is_left_out(part):
    run, lanes = aside(part, -1.0, 4.0)
    assert part("lane_changes").lane_changes(run.states, 0, lanes, DT) == []


@pytest.mark.parametrize(("since", "turn", "shown"), [(0, 1.0, 2.0), (10, 1.0, 1.0), (0, -1.0, 0.0), (30, 1.0, 0.0)])
def test_a_change_was_shown_from_when_its_side_blinks_without_a_break(part, since, turn, shown):
    run, lanes = aside(part, 2.0, 3.5)
    turns = np.where(np.arange(len(run.plans.turn)) >= since, turn, np.nan)
    plans = replace(run.plans, turn=turns)
    [change] = part("lane_changes").shown_lane_changes(run.states, 0, plans, lanes, DT)
    assert change.shown == pytest.approx(shown, abs=0.3)


def test_the_text_on_lane_changes_counts_those_that_were_shown_for_three_seconds(part):
    said = part("lane_changes").said
    assert said(["4.0/3.0 5.0/0.4", "", "6.0/3.2"]) == (
        "3, median 5.0 s, 5 to 95 % 4.1 to 5.9 s, 2 of them shown for 3 s before"
    )
    assert said(["4.0", "6.0"]) == "2, median 5.0 s, 5 to 95 % 4.1 to 5.9 s"
    assert said([]) == "0"
