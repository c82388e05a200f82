"""Right of way at junctions of straight lanes through the origin, with a limit of 10 m/s; cars are 4.5 m long.

Strips of 2.2 m: the area of two lanes through the origin reaches from -1.1 to 1.1 m, a front waits at -1.4 m at the
latest, and a rear has left at 1.4 m.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from damage import with_cell

import interdrive as idr
from interdrive.results.story import story
from interdrive.scenario import Lanelets
from interdrive.scenario.control import Priorities
from interdrive.simulation import Simulation
from interdrive.testing.worlds import Car, crossing, problem, world

HALF = 2.25
MOUTH = -1.4
NORTH = np.pi / 2
RULES = {"rules.precedence": True}
#: x, y and heading per metre of the four ways of a two-way cross: from west, south, east and north.
ARMS = [((1, 0), (0, -1.75)), ((0, 1), (1.75, 0)), ((-1, 0), (0, 1.75)), ((0, -1), (-1.75, 0))]


def limited(lanelets):
    return replace(lanelets, speed_limit=np.full(len(lanelets.ids), 10.0))


def lanes(*ways, half_length=100.0, width=3.0):
    """Straight lanes, ids 1, 2, ...; a way is its direction and the point on it beside the origin."""
    along = np.linspace(-half_length, half_length, 81)[:, None]
    left, right = [], []
    for direction, place in ways:
        aside = 0.5 * width * np.array([-direction[1], direction[0]])
        middle = np.array(place) + along * np.array(direction)
        left.append(middle + aside)
        right.append(middle - aside)
    n = len(ways)
    none, no = np.full(n, -1), np.zeros(n, dtype=bool)
    ids = np.arange(1, n + 1)
    return limited(
        Lanelets(
            ids, tuple(left), tuple(right), ((),) * n, ((),) * n, none, no, none, no, np.full(n, np.nan), ((),) * n
        )
    )


def car(agent_id, way, before_mouth, velocity=10.0, mouth=MOUTH, time=200):
    """An agent whose front is so far before its first mouth [m]; it wants to get 60 m beyond the origin."""
    direction, place = np.array(way[0]), np.array(way[1])
    x, y = place + (mouth - before_mouth - HALF) * direction
    heading = float(np.arctan2(direction[1], direction[0]))
    goal = place + 60.0 * direction
    return problem(
        agent_id, x, y, velocity, heading, goal=tuple(goal), goal_size=(20.0, 3.5), goal_orientation=heading,
        time_step=(0, time),
    )  # fmt: skip


EAST_WAY, NORTH_WAY = ((1, 0), (0, 0)), ((0, 1), (0, 0))


def told(scenario, **settings):
    """Agent -> distance from its front to where it has to stop [m], for how long [s], and for which vehicle."""
    simulation = Simulation(scenario, settings=RULES | settings, threads=1)
    scene = simulation.world.scene()
    found = {}
    for agent in simulation.driving:
        ego = simulation.world.view(scene, agent).ego
        front = float(ego.route.project(np.array([ego.x]), np.array([ego.y]))[0][0]) + HALF
        found[agent] = (
            pytest.approx(ego.stop_s - front, abs=0.02),
            pytest.approx(ego.stop_release, abs=0.01),
            ego.stop_by,
        )
    return found


FREE = (np.inf, np.inf, None)


def test_of_two_that_arrive_together_the_right_one_goes_and_the_other_knows_when():
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 20.0), car(2, NORTH_WAY, 20.0)])
    orders = told(scenario)
    assert orders[2] == FREE, "it comes from the right"
    # The other one has left after 20 + 2.8 + 4.5 m at 10 m/s, 0.3 s more are kept.
    assert orders[1] == (20.0, 3.03, 2)


def test_a_gap_that_is_large_enough_is_taken():
    # It has left after 1.5 + 0.73 s, 1 s before the other one comes.
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 15.0), car(2, NORTH_WAY, 60.0)])
    assert told(scenario) == {1: FREE, 2: FREE}


@pytest.mark.parametrize(("metres", "goes"), [(31.0, True), (28.0, False)])
def test_a_gap_has_to_hold_if_the_other_one_becomes_faster_by_two_metres_per_second(metres, goes):
    # From rest the first one has left after 0.3 + 3.2 s and wants 1 s more. The other one comes with 5 m/s, 2 s later
    # with 7 m/s, and needs 4.7 s for 31 m. If it became faster all the way, it would need 4.3 s.
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 0.1, 0.0), car(2, NORTH_WAY, metres, 5.0)])
    assert (told(scenario)[1] == FREE) == goes


def test_one_that_stands_and_goes_first_is_expected_to_become_as_fast_as_the_limit():
    # With 1 m/s² it comes after 0.3 + 6.9 s. The other one has left after 57.3 m at 9 m/s, 6.4 s, and wants 1 s more.
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 50.0, 9.0), car(2, NORTH_WAY, 23.7, 0.0)])
    assert told(scenario)[1][2] == 2


@pytest.mark.parametrize("predictor", ["neural", "lane_following", "constant_velocity"])
def test_one_that_goes_first_does_not_slow_down_for_one_that_was_told_to_wait(predictor):
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 25.0), car(2, NORTH_WAY, 25.0)])
    run = idr.simulate(scenario, predictor=predictor, settings=RULES, threads=1)
    slowest = [float(run.states.velocity[row, run.states.valid[row]].min()) for row in range(2)]
    assert slowest[0] < 7.0 < 9.8 < slowest[1], "m/s"
    assert set(run.outcomes.outcome) == {"goal_reached"}


def test_signs_turn_the_order_around():
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 20.0), car(2, NORTH_WAY, 20.0)])
    scenario = replace(scenario, priorities=Priorities(ranks=((1, (4, 5, 4)),)))
    orders = told(scenario)
    assert orders[1] == FREE
    assert orders[2] == (20.0, 3.03, 1)


@pytest.mark.parametrize("ids", [(1, 2, 3, 4), (4, 1, 2, 3)])
def test_of_four_that_arrive_together_two_opposite_ones_go_at_once(ids):
    problems = [car(i, way, 20.0, mouth=-3.15) for i, way in zip(ids, ARMS, strict=True)]
    orders = told(world(lanes(*ARMS), problems=problems))
    first = {i for i in ids if orders[i] == FREE}
    opposite = [{ids[0], ids[2]}, {ids[1], ids[3]}]
    assert first == next(pair for pair in opposite if 1 in pair), "those with the least id"
    # The second area of the others is free after 20 + 6.3 + 4.5 m.
    assert all(orders[i][:2] == (20.0, 3.38) for i in set(ids) - first)


def longest_stand(run):
    """The longest time for which an agent stands without a break [s]."""
    stands = np.pad(run.states.valid & (run.states.velocity < 0.1), ((0, 0), (1, 1))).astype(int)
    starts, ends = (np.argwhere(np.diff(stands) == way) for way in (1, -1))
    return 0.1 * (ends - starts)[:, 1].max(initial=0)


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "lawful", "idm_mobil", "cc"])
@pytest.mark.parametrize("velocity", [10.0, 0.0])
def test_four_at_a_cross_get_through_without_contact(planner, velocity):
    before = 20.0 if velocity else 0.5
    problems = [car(i + 1, way, before, velocity, mouth=-3.15) for i, way in enumerate(ARMS)]
    run = idr.simulate(world(lanes(*ARMS), problems=problems), planner=planner, settings=RULES, threads=1)
    assert set(run.outcomes.outcome) == {"goal_reached"}
    assert longest_stand(run) < 6.0, "seconds"
    assert "speeding" not in run.violations.rule, "none hurries to get out of another one's way"


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_two_that_meet_in_a_narrow_street_pass_one_after_the_other(planner):
    # Both lanes lie on the same 3 m between x = -8 and 8 m, and beside each other beyond 24 m.
    def bent(sign):
        x = np.linspace(-100, 100, 201)
        u = np.clip((np.abs(x) - 8.0) / 16.0, 0.0, 1.0)
        aside = 1.75 * u**2 * (3.0 - 2.0 * u)
        middle = np.column_stack([sign * x, -sign * aside])
        half = 1.5 * np.array([0.0, sign])
        return middle + half, middle - half

    (left1, right1), (left2, right2) = bent(1.0), bent(-1.0)
    lanelets = limited(
        Lanelets(
            np.array([1, 2]), (left1, left2), (right1, right2), ((), ()), ((), ()), np.full(2, -1), np.zeros(2, bool),
            np.full(2, -1), np.zeros(2, bool), np.full(2, np.nan), ((), ()),
        )
    )  # fmt: skip
    problems = [
        problem(1, -70.0, -1.75, 8.0, 0.0, goal=(80.0, -1.75), goal_size=(20.0, 3.5), time_step=(0, 600)),
        problem(
            2, 70.0, 1.75, 8.0, np.pi, goal=(-80.0, 1.75), goal_size=(20.0, 3.5), goal_orientation=np.pi,
            time_step=(0, 600),
        ),
    ]  # fmt: skip
    run = idr.simulate(world(lanelets, problems=problems), planner=planner, settings=RULES, threads=1)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    inside = np.abs(run.states.x) < 8.0
    assert not (inside & run.states.valid).all(axis=0).any(), "never both in the street"


@pytest.mark.parametrize(("rear", "is_held"), [(5.4, True), (5.6, False)])
def test_a_junction_is_not_entered_without_room_behind_it(rear, is_held):
    # The car needs 4.5 + 1 m behind 1.4 m.
    standing = Car(9, 1.4 + rear + HALF)
    scenario = world(limited(crossing()), cars=[standing], problems=[car(1, EAST_WAY, 10.0, 8.0)])
    assert told(scenario)[1] == ((10.0, np.inf, 9) if is_held else FREE)
    assert told(scenario, **{"rules.keep_clear": False})[1] == FREE


def test_agents_wait_for_a_vehicle_that_does_not_obey():
    # The recorded car comes from the left and would have to wait; it cannot stop any more.
    recorded = Car(9, 0.0, MOUTH - 15.0 - HALF, 12.0, NORTH)
    left = Priorities(priority_side="left")
    scenario = replace(world(limited(crossing()), cars=[recorded], problems=[car(1, EAST_WAY, 15.0)]), priorities=left)
    order = told(scenario)[1]
    assert order[0] == 15.0 and order[2] == 9
    run = idr.simulate(scenario, agents=[1], settings=RULES, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert "agent" not in run.violations.source


@pytest.mark.parametrize(("trusts", "goes"), [(False, False), (True, True)])
def test_one_that_trusts_others_counts_on_a_recorded_car_that_would_have_to_brake_hard(trusts, goes):
    # 12 m/s, its front 15 m before the area: 4.8 m/s² would stop it, and by the map it has to wait.
    recorded = Car(9, 0.0, MOUTH - 15.0 - HALF, 12.0, NORTH)
    left = Priorities(priority_side="left")
    scenario = replace(world(limited(crossing()), cars=[recorded], problems=[car(1, EAST_WAY, 15.0)]), priorities=left)
    settings = RULES | {"rules.trust_others": trusts}
    simulation = Simulation(scenario, agents=[1], settings=settings, threads=1)
    ego = simulation.world.view(simulation.world.scene(), 1).ego
    assert (ego.stop_by is None) == goes
    # Its planner avoids the car all the same.
    run = idr.simulate(scenario, agents=[1], settings=settings, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert "agent" not in run.violations.source


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "lawful", "idm_mobil", "cc"])
def test_a_recorded_car_that_does_not_give_way_breaks_a_rule_and_the_agent_none(planner):
    # It comes from the left, and could still stop. The front of the agent would be at the area 2 s from now as well.
    recorded = Car(9, 0.0, 20.0 - MOUTH + HALF, 10.0, -NORTH)
    ways = limited(lanes(EAST_WAY, ((0, -1), (0, 0))))
    scenario = world(ways, cars=[recorded], problems=[car(1, EAST_WAY, 20.0)])
    run = idr.simulate(scenario, agents=[1], planner=planner, settings=RULES, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    found = run.violations
    assert (found.source, found.participant_id.tolist(), found.rule) == (("replayed",), [9], ("right_of_way",))
    assert found.partner_id.tolist() == [1]


@pytest.mark.parametrize(("front", "waits"), [(-0.6, True), (-1.4, False)])
def test_a_vehicle_that_creeps_in_the_junction_keeps_others_out_and_one_before_it_does_not(front, waits):
    # It comes from the left, so it would have to wait; the area begins at -1.1 m.
    creeping = Car(9, 0.0, front - HALF, 0.2, NORTH)
    left = Priorities(priority_side="left")
    scenario = replace(world(limited(crossing()), cars=[creeping], problems=[car(1, EAST_WAY, 15.0)]), priorities=left)
    order = told(scenario)[1]
    assert (order[2] == 9) if waits else (order == FREE)


@pytest.mark.parametrize(("rear", "waits"), [(1.0, True), (1.2, False)])
def test_one_that_stands_behind_the_junction_with_its_rear_near_holds_nobody(rear, waits):
    # The area ends at 1.1 m. In a jam vehicles would wait for each other in a circle because of some decimetres.
    jam = Car(9, 0.0, rear + 2.0 * HALF + 1.0 + HALF, 0.0, NORTH)
    problems = [car(1, EAST_WAY, 0.1, 0.0), car(2, NORTH_WAY, MOUTH - rear - 2.0 * HALF, 0.0)]
    order = told(world(limited(crossing()), cars=[jam], problems=problems))[1]
    assert (order[2] == 2) if waits else (order == FREE)


def test_one_agent_may_take_the_right_of_way():
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 15.0), car(2, NORTH_WAY, 20.0)])
    run = idr.simulate(scenario, settings=RULES, rules={1: {"precedence": False}}, threads=1)
    assert "collision" not in run.outcomes.outcome
    first = [float(np.argmax(run.states.valid[row] & (run.states.x[row] + run.states.y[row] > 0))) for row in range(2)]
    assert first[0] < first[1], "the other one waits although it comes from the right"


def test_runs_do_not_depend_on_threads_or_the_order_of_agents():
    def problems(ids):
        return [car(i, ARMS[i - 1], 20.0 + 3 * i, mouth=-3.15) for i in ids]

    one = idr.simulate(world(lanes(*ARMS), problems=problems((1, 2, 3, 4))), settings=RULES, threads=1)
    two = idr.simulate(world(lanes(*ARMS), problems=problems((3, 1, 4, 2))), settings=RULES, threads=2)
    assert one.digest == two.digest


class Obedient:
    """Keeps its speed along its path, and stops where it is told to."""

    obeys_rules = True

    def plan(self, view: Any, predictions: Any) -> idr.Trajectory:
        ego = view.ego
        front = ego.s + ego.vehicle.rear_axle_to_center + 0.5 * ego.vehicle.length
        way, speed, dt = [0.0], [ego.velocity], view.dt
        for step in range(30):
            room = ego.stop_s - 0.5 - front - way[-1] if step * dt < ego.stop_release else np.inf
            allowed = np.sqrt(6.0 * max(room, 0.0)) if np.isfinite(room) else np.inf
            speed.append(float(np.clip(min(10.0, allowed), max(0.0, speed[-1] - 5 * dt), speed[-1] + 2 * dt)))
            way.append(way[-1] + 0.5 * (speed[-2] + speed[-1]) * dt)
        east, north = np.cos(ego.orientation), np.sin(ego.orientation)
        x, y = ego.x + np.array(way) * east, ego.y + np.array(way) * north
        return idr.Trajectory(x, y, np.full(31, ego.orientation), np.array(speed))


def test_a_planner_in_python_is_told_the_same_and_can_obey():
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 20.0), car(2, NORTH_WAY, 20.0)])
    run = idr.simulate(scenario, planner=Obedient, settings=RULES, threads=1)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    x = run.states.x[0, run.states.valid[0]]
    assert np.argmax(x + HALF > MOUTH) * 0.1 >= 3.0, "seconds until it enters"


def test_orders_are_recorded_and_told(tmp_path):
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 20.0), car(2, NORTH_WAY, 20.0)])
    run = idr.simulate(scenario, settings=RULES, threads=1)
    orders = run.orders
    assert (set(orders.agent_id.tolist()), set(orders.by_id.tolist())) == ({1}, {2})
    # Once the other one is in the crossing, it may follow so slowly that it arrives after it.
    assert orders.kind[0] == "yield" and set(orders.kind) <= {"yield", "follow"}
    assert orders.first_time_step[0] == 0
    entered = int(np.argmax(run.states.x[0] + HALF > MOUTH))
    assert orders.last_time_step.max() < entered, "it does not enter before it may"
    again = idr.Run.load(run.save(tmp_path / "run"))
    assert again.orders.to_arrow().equals(orders.to_arrow())
    assert "slowing before a junction: it gave way to 2," in "\n".join(story(again, 1))


def test_without_the_rule_there_are_no_orders(tmp_path):
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 20.0), car(2, NORTH_WAY, 20.0)])
    for settings in ({"rules.precedence": False}, RULES | {"record.orders": False}):
        run = idr.simulate(scenario, settings=settings, threads=1)
        assert run.orders is None
        assert not (run.save(tmp_path / str(len(settings))) / "orders.parquet").exists()


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("by_id", 4711, "by_id: 4711 has no states"),
        ("kind", "wish", "kind: 'wish' is not one of yield, exit, queue"),
        ("last_time_step", -1, r"last_time_step: -1 in row \d+ is before the first one"),
    ],
)
def test_a_damaged_table_of_orders_is_refused(tmp_path, column, value, words):
    scenario = world(limited(crossing()), problems=[car(1, EAST_WAY, 20.0), car(2, NORTH_WAY, 20.0)])
    folder = idr.simulate(scenario, settings=RULES, threads=1).save(tmp_path / "run")
    path = folder / "orders.parquet"
    pq.write_table(with_cell(column, value)(pq.read_table(path)), path)
    with pytest.raises(idr.ResultsError, match=rf"orders\.parquet: {words}"):
        idr.Run.load(folder)
