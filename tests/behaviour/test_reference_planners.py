"""`cc`, `r157`, `rss` and `fsm` as planners: in one dimension on a straight road, and rules of the road elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive import reference_drivers
from interdrive.alks import worlds
from interdrive.scenario import StopLine, TrafficLight
from interdrive.testing import Car, problem, straight_road, world

DRIVERS = tuple(reference_drivers.DRIVERS)
SETTINGS = {"view.sensor_radius": 500.0}


def drive(scenario, planner, agents="problems"):
    run = idr.simulate(
        scenario, agents=agents, planner=planner, predictor="constant_velocity", threads=1, settings=SETTINGS
    )
    row = np.searchsorted(run.states.participant_id, run.agents[0].id)
    return run, run.states.velocity[row], run.states.x[row]


def straight(scenario):
    """The same with footprints that keep their direction, as in one dimension."""
    table = scenario.obstacles
    along = table.velocity * np.cos(table.orientation)
    return replace(scenario, obstacles=replace(table, orientation=np.zeros_like(along), velocity=along))


def drawn(kind, number):
    """Cases, with those around them: one that a little more room decides is decided by rounding, too."""
    draw = np.random.default_rng(sum(map(ord, kind)))
    for _ in range(number):
        velocity, sideways = draw.uniform(8.0, 36.0), draw.uniform(0.3, 1.7)
        if kind == "cut_in":
            other, gap = max(3.0, velocity * draw.uniform(0.3, 0.9)), draw.uniform(3.0, 50.0)
            case = {
                "velocity": velocity,
                "other_velocity": min(other, velocity - 1.0),
                "gap": gap,
                "sideways": sideways,
            }
        elif kind == "cut_out":
            case = {"velocity": velocity, "front_distance": draw.uniform(2.0, 50.0), "sideways": sideways}
        else:
            case = {"velocity": velocity, "deceleration": draw.uniform(2.0, 9.5)}
        wider = {"gap": 0.5, "front_distance": 0.5, "sideways": 0.03, "deceleration": 0.1}
        around = [
            {**case, name: case[name] + sign * by} for name, by in wider.items() if name in case for sign in (1, -1)
        ]
        yield case, around


def sideways_angle(case):
    return case["sideways"] / case["other_velocity"]


#: What each is for: r157 for cut-ins alone.
PAIRS = [
    (kind, driver)
    for kind in ("cut_in", "cut_out", "car_following")
    for driver in DRIVERS
    if kind == "cut_in" or driver != "r157"
]


@pytest.mark.parametrize("number", [32, pytest.param(80, marks=pytest.mark.long)])
@pytest.mark.parametrize(("kind", "driver"), PAIRS)
def test_on_a_straight_road_it_ends_as_in_one_dimension(kind, driver, number):
    law, build = getattr(reference_drivers, kind), getattr(worlds, kind)
    clear, crashes, different = 0, 0, 0
    for case, around in drawn(kind, number):
        found = law(driver, **case)
        if any(law(driver, **near).crash[0] != found.crash[0] for near in around):
            continue
        # These two heed the sideways speed, which only a heading shows; a footprint that is turned takes more room.
        needs_heading = kind == "cut_in" and driver in ("rss", "fsm")
        if needs_heading and sideways_angle(case) > 0.09:
            continue
        kept = () if kind == "cut_in" else (float(found.kept_distance[0]),)
        scenario = worlds.scenario("case", build(case, 250, *kept), case["velocity"])
        scenario = scenario if needs_heading else straight(scenario)
        run, _, _ = drive(scenario, f"{driver},calm=60,keep_distance=false", agents=[worlds.EGO])
        different += (run.outcomes.outcome[0] == "collision") != found.crash[0]
        clear, crashes = clear + 1, crashes + int(found.crash[0])
    # A turned footprint takes more room: among many more cases its corner touches now and then.
    assert different == 0
    assert clear >= 0.35 * number
    assert kind == "car_following" or needs_heading or crashes > 0


@pytest.mark.parametrize("driver", DRIVERS)
def test_it_stops_before_a_red_light_and_behind_a_standing_vehicle(driver):
    lanes = replace(straight_road(400.0), speed_limit=np.array([14.0]))
    agent = problem(100, 20.0, velocity=12.0, goal=(350.0, 0.0), time_step=(0, 400))
    light = TrafficLight(7, (("red", 1000),))
    line = StopLine(1, np.array([[150.0, 1.75], [150.0, -1.75]]), ((1, (7,)),))
    signals = replace(world(lanes, problems=[agent], steps=400), traffic_lights=(light,), stop_lines=(line,))
    _, speed, x = drive(signals, driver)
    assert np.nanmin(speed) < 0.1
    assert 140.0 < np.nanmax(x) + 2.25 <= 150.0, "m, its front"
    run, speed, x = drive(world(lanes, cars=[Car(5, 150.0)], problems=[agent], steps=400), driver)
    assert run.outcomes.outcome[0] != "collision"
    assert 135.0 < np.nanmax(x[:300]) + 2.25 < 147.75, "m, its front"


@pytest.mark.parametrize("driver", DRIVERS)
def test_it_follows_a_slower_leader_at_the_distance_that_it_keeps(driver):
    lanes = replace(straight_road(900.0), speed_limit=np.array([20.0]))
    agent = problem(100, 20.0, velocity=18.0, goal=(850.0, 0.0), time_step=(0, 500))
    run, speed, x = drive(world(lanes, cars=[Car(5, 120.0, velocity=10.0)], problems=[agent], steps=500), driver)
    assert run.outcomes.outcome[0] != "collision"
    at = 400
    assert speed[at] == pytest.approx(10.0, abs=0.7), "m/s"
    leader = 120.0 + 10.0 * 0.1 * at
    kept = {"cc": 20.0, "r157": 20.0, "rss": 20.0, "fsm": 16.9}[driver]
    assert leader - x[at] - 4.5 == pytest.approx(kept, abs=0.5), "m"


def test_what_a_leader_hides_is_seen_when_the_leader_is_aside():
    lanes = replace(straight_road(400.0), speed_limit=np.array([15.0]))
    agent = problem(100, 20.0, velocity=12.0, goal=(380.0, 0.0), time_step=(0, 300))
    # A vehicle drives away before a standing one; nothing but the standing one is a reason to brake.
    hidden = [Car(5, 60.0, velocity=12.0), Car(6, 90.0)]
    aside = [replace(hidden[0], y=0.5), hidden[1]]
    first = []
    for cars in (hidden, aside):
        _, speed, _ = drive(world(lanes, cars=cars, problems=[agent]), "cc")
        first.append(int(np.flatnonzero(speed < 11.9)[0]))
    assert first[1] < first[0], "time step at which it brakes"


def test_a_repeated_run_and_eight_threads_give_the_same_bits():
    digests = {
        idr.simulate("t_junction", planner=driver, predictor="constant_velocity", threads=threads).digest
        for threads in (1, 8)
        for driver in ("fsm",)
    }
    assert len(digests) == 1
