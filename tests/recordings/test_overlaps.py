"""Recorded vehicles that are in each other are noted, and their contacts are no collisions."""

import time
from dataclasses import replace

import commonroad_documents as cr
import pytest

from interdrive import score, simulate
from interdrive.recordings import overlapping, repaired
from interdrive.scenario import Shape
from interdrive.testing import CAR, Car, straight_road, world


def pairs(*cars, kinds=None, shapes=None, steps=40):
    scenario = world(straight_road(600.0, lanes=3), cars=cars, steps=steps)
    obstacles = scenario.obstacles
    if kinds:
        obstacles = replace(obstacles, kinds=kinds)
    if shapes:
        obstacles = replace(obstacles, shapes=shapes)
    return overlapping(obstacles, scenario.dt)


def test_vehicles_that_are_in_each_other_at_some_second_are_listed_by_ascending_ids():
    first = Car(7, x=10.0, velocity=10.0)
    assert pairs(first, Car(3, x=12.0, velocity=10.0)) == ((3, 7),)
    assert pairs(first, Car(3, x=14.6, velocity=10.0)) == ()  # 4.5 m long: 0.1 m apart
    assert pairs(first, Car(3, x=12.0, y=1.9, velocity=10.0)) == ()  # 1.8 m wide: 0.1 m apart
    assert pairs(first, Car(3, x=30.0)) == ((3, 7),)  # drives through it after 2 s


def test_turned_boxes_count_as_they_lie():
    """Two boxes whose corners are within reach of each other, but not in each other."""
    assert pairs(Car(1, x=20.0), Car(2, x=23.0, y=1.7, orientation=0.785)) == ((1, 2),)
    assert pairs(Car(1, x=20.0), Car(2, x=23.4, y=3.1, orientation=0.785)) == ()


def test_people_and_bicycles_do_not_count_nor_does_what_stands_for_ever():
    cars = (Car(1, x=10.0, velocity=5.0), Car(2, x=12.0, velocity=5.0))
    assert pairs(*cars, kinds=("car", "pedestrian")) == ()
    assert pairs(*cars, kinds=("bicycle", "car")) == ()
    assert pairs(*cars, kinds=("truck", "motorcycle")) == ((1, 2),)


def test_footprints_of_other_shapes_count_by_their_boxes():
    cars = (Car(1, x=10.0), Car(2, x=17.0))
    long = Shape("rectangle", length=4.5, width=1.8, center=(3.0, 0.0))
    assert pairs(*cars, shapes=(long, Shape("circle", radius=2.0))) == ((1, 2),)
    assert pairs(*cars, shapes=(replace(long, center=(-3.0, 0.0)), Shape("circle", radius=2.0))) == ()


def test_thousands_of_vehicles_are_looked_at_in_no_time():
    cars = [Car(number, x=6.0 * number, y=0.001 * number) for number in range(1, 5001)] + [Car(9000, x=900.0, y=1.0)]
    assert pairs(*cars, steps=0) == ((150, 9000),)


@pytest.mark.long
def test_a_thousand_vehicles_in_each_other_for_a_minute_are_looked_at_within_seconds():
    crowd = [Car(number, x=10.0 + 0.001 * number, velocity=1.0) for number in range(1, 1001)]
    begun = time.process_time()
    assert len(pairs(*crowd, steps=600)) == 1000 * 999 // 2
    assert time.process_time() - begun < 8.0  # of which most is making the cars; pair by pair it took 40 s


def test_pairs_that_meet_later_are_found_beside_those_known_before():
    cars = [Car(5, x=10.0), Car(3, x=12.0), Car(9, x=40.0), Car(7, x=0.0, velocity=10.0), Car(2, x=0.0, y=3.5)]
    assert pairs(*cars) == ((3, 5), (3, 7), (5, 7), (7, 9))
    assert pairs(*reversed(cars)) == ((3, 5), (3, 7), (5, 7), (7, 9))


def test_vehicles_that_part_and_others_that_come_are_each_listed_once():
    cars = (Car(1, x=10.0, velocity=10.0), Car(2, x=11.0, velocity=5.0), Car(3, x=40.0))
    assert pairs(*cars) == ((1, 2), (1, 3))
    assert pairs(*cars, steps=0) == ((1, 2),)


def test_a_footprint_without_parts_is_a_point():
    cars = (Car(1, x=10.0), Car(2, x=11.0), Car(3, x=11.5))
    assert pairs(*cars, shapes=(Shape("group"), Shape("polygon"), CAR)) == ((1, 3), (2, 3))


def test_a_note_names_five_pairs_and_counts_the_others():
    cars = [Car(number, x=10.0 + 0.1 * number) for number in range(1, 5)]
    found = repaired(world(straight_road(), cars=cars))
    assert len(found.overlaps) == 6
    assert found.notes == (
        (
            "recordings overlap; they take part, but their contacts are no collisions: "
            "1 and 2, 1 and 3, 1 and 4, 2 and 3, 2 and 4 and 1 more"
        ),
    )


def drives_through(tmp_path, settings=None):
    """Outcome of an agent that replays its recording, which leads through a standing car."""

    def track(number, x, velocity):
        states = [cr.state(i, x + 0.1 * i * velocity, orientation=0.0, velocity=velocity) for i in range(1, 51)]
        return cr.car(number, cr.initial(x, velocity=velocity), states)

    path = cr.saved(tmp_path, cr.document(track(30, 5.0, 10.0) + track(31, 25.0, 0.0)))
    return simulate(path, agents=[30], planner="recorded", settings=settings)


def test_contacts_of_overlapping_recordings_are_no_collisions_unless_they_are_read_raw(tmp_path):
    assert drives_through(tmp_path).outcomes.outcome == ("goal_reached",)
    raw = drives_through(tmp_path, {"recording.raw": True})
    assert raw.outcomes.outcome == ("collision",)


def test_vehicles_that_overlap_are_not_scored_unless_they_are_asked_for():
    cars = [Car(1, x=5.0, velocity=10.0), Car(2, x=7.0, velocity=10.0), Car(3, x=60.0, velocity=10.0)]
    run = simulate(repaired(world(straight_road(), cars=cars, steps=40)), planner="idm")
    found = score(run)
    assert found.ids.tolist() == [3]
    assert "not scored, because their recordings overlap those of others: 1, 2" in found.notes
    assert score(run, [1]).ids.tolist() == [1]


@pytest.mark.parametrize("threads", [1, 2])
def test_other_contacts_of_such_vehicles_are_still_collisions(threads):
    """An agent runs into a third car, which its recording never touches."""
    cars = [Car(1, x=5.0, velocity=10.0), Car(2, x=7.0, velocity=10.0), Car(3, x=60.0)]
    scenario = repaired(world(straight_road(), cars=cars, steps=40))
    scenario = replace(scenario, overlaps=((1, 2),))
    run = simulate(scenario, agents=[1], planner="recorded", threads=threads)
    assert run.outcomes.partner_id.tolist() == [-1]
    longer = replace(scenario, obstacles=world(straight_road(), cars=cars, steps=80).obstacles)
    run = simulate(longer, agents=[1], planner="recorded", threads=threads)
    assert run.outcomes.outcome == ("collision",)
    assert run.outcomes.partner_id.tolist() == [3]
