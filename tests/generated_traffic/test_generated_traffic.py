"""Vehicles enter where there is a gap, drive through the map and leave it."""

from dataclasses import replace

import numpy as np
import pytest
from rings import ring

import interdrive as idr
from interdrive.run.flows import lane_flows
from interdrive.scenario.known_goals import MapEnds
from interdrive.scenario.native import core_road
from interdrive.simulation import Simulation
from interdrive.testing import Car, problem, straight_road, world
from interdrive.traffic import LaneGraph, TrafficMaker

FAST = {"record.violations": False, "record.orders": False}


def road(length=600.0, lanes=2, limit=30.0, **others):
    lanelets = straight_road(length, lanes)
    return world(replace(lanelets, speed_limit=np.full(lanes, limit)), steps=0, **others)


def run_of(scenario, traffic, *, agents=0, seed=1, threads=1, **settings):
    return idr.simulate(
        scenario,
        agents=agents,
        traffic=traffic,
        predictor="lane_following",
        settings={**FAST, **settings},
        seed=seed,
        threads=threads,
    )


def hardest_braking(run, seconds=2.0):
    """Largest deceleration of anybody within some seconds after an entry, of those within 150 m behind it [m/s²]."""
    states, dt = run.states, run.scenario.dt
    worst = 0.0
    for number, entered in zip(run.demand.agent_id.tolist(), run.demand.entered.tolist(), strict=True):
        if not entered > 0.0:
            continue
        row, first = int(np.searchsorted(states.participant_id, number)), round(entered / dt)
        span = slice(first, first + round(seconds / dt) + 1)
        near = np.abs(states.x[:, first] - states.x[row, first]) < 150.0
        worst = max(worst, -np.nanmin(np.where(states.valid[near, span], states.acceleration[near, span], 0.0)))
    return worst


def test_vehicles_cross_the_map_without_anybody_braking_hard_for_an_entry():
    run = run_of(road(), "idm_mobil,rate=1200,duration=40")
    assert set(run.outcomes.outcome) == {"goal_reached"}
    assert len(run.demand.agent_id) > 20
    assert np.isfinite(run.demand.left).all()
    assert hardest_braking(run) < 4.0
    assert all(agent.origin == "generated" for agent in run.agents)


def test_one_digest_for_any_number_of_threads_and_another_for_another_seed():
    runs = [run_of(road(300.0), "idm:0.5+rollout:0.5,rate=900,duration=10", threads=n) for n in (1, 2, 8)]
    assert len({run.digest for run in runs}) == 1
    assert {*runs[0].outcomes.planner} == {"idm", "rollout"}
    assert run_of(road(300.0), "idm:0.5+rollout:0.5,rate=900,duration=10", seed=2).digest != runs[0].digest


def test_one_lanes_demand_is_the_same_without_the_other_lane():
    both = run_of(road(300.0), "idm,rate=900,duration=30,density=0").demand
    alone = run_of(road(300.0), "idm,rates=[2:900],duration=30,density=0").demand
    own = both.lane_id == 2
    assert own.sum() < len(own)
    np.testing.assert_array_equal(both.due[own], alone.due)
    assert [kind for kind, mine in zip(both.kind, own, strict=True) if mine] == list(alone.kind)
    np.testing.assert_allclose(both.route_length[own], alone.route_length)


def test_who_waits_enters_later_and_the_table_says_so(tmp_path):
    # 40 m before the lane's end, beyond which nothing goes on, a parked car blocks the lane.
    scenario = road(300.0, lanes=1, cars=[Car(7, 60.0)])
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, is_static=np.array([True])))
    run = run_of(scenario, "idm,rate=1500,duration=60,density=0", **{"rules.passing": False, "step.max_steps": 700})
    demand = run.demand
    entered = np.isfinite(demand.entered)
    assert 4 <= entered.sum() < len(entered)
    assert set(run.outcomes.outcome) == {"time_limit"}
    never = run.outcomes.reason[int(np.flatnonzero(~entered)[0])]
    assert never.startswith("found no room to enter within")
    into = lane_flows(run)[0]
    assert (into.side, into.lane_id, into.vehicles, into.due) == ("in", 1, entered.sum(), len(entered))
    assert into.queue == len(entered) - entered.sum()
    again = idr.load(run.save(tmp_path / "run"))
    assert again.digest == run.digest
    assert repr(lane_flows(again)) == repr(lane_flows(run))
    np.testing.assert_array_less(demand.due[entered] - 1e-9, demand.entered[entered])


def test_the_last_vehicle_to_leave_counts_and_so_does_the_empty_road_behind_it():
    run = run_of(road(300.0, lanes=1), "idm,rate=120,duration=60,density=0")
    left = run.demand.left
    assert np.isfinite(left).all()
    assert np.max(left) == pytest.approx((run.states.n_steps - 1) * run.scenario.dt), "it ends with the last one"
    assert np.max(left) < 60.0
    out = next(row for row in lane_flows(run) if row.side == "out")
    assert out.vehicles == len(left) > 0
    assert out.flow == pytest.approx(60.0 * len(left)), "per hour, in 60 s"


def flows(rate, duration):
    """Flows on two lanes of 1 km, by cars with a time gap of 1 s."""
    settings = {"traffic.min_headway": 1.0, "traffic.mix": (1, 0, 0), "traffic.time_gap": (1.0, 0.0)}
    return lane_flows(run_of(road(1000.0, 2), f"idm,rate={rate},duration={duration},warm_up=40", **settings))


@pytest.mark.long
def test_as_many_leave_a_road_as_enter_it():
    calm = flows(1200, 640)
    into, out = (sum(row.vehicles for row in calm if row.side == side) for side in ("in", "out"))
    assert into > 350
    assert out == pytest.approx(into, rel=0.05)
    assert all(row.queue <= 3 for row in calm if row.side == "in")


@pytest.mark.long
def test_a_road_carries_what_it_can_and_the_rest_queues():
    busy = flows(3000, 100)
    out = [row.flow for row in busy if row.side == "out"]
    assert all(1700 <= flow <= 2450 for flow in out), out
    assert all(row.queue >= 5 for row in busy if row.side == "in")


@pytest.mark.parametrize("seed", range(4))
def test_a_dense_fill_with_very_different_drivers_does_not_crash(seed):
    run = run_of(
        road(400.0, 3),
        {"density": 60.0, "speed_factor": (1.0, 0.3), "planner": "idm", "duration": 1.0},
        seed=seed,
    )
    assert len(run.agents) > 50
    assert set(run.outcomes.outcome) == {"goal_reached"}


def test_a_ring_has_no_entry_and_is_filled_by_density():
    scenario = world(ring(4, 60.0), steps=0)
    with pytest.raises(idr.InputError, match=r"traffic.rate: .* use traffic.density"):
        run_of(scenario, "rate=600")
    run = run_of(scenario, "idm,density=40,duration=30")
    assert len(run.agents) == round(0.04 * 2.0 * np.pi * 60.0)
    assert set(run.outcomes.outcome) == {"goal_reached"}
    assert run.states.n_steps == 301
    with pytest.raises(idr.InputError, match="do not fit into a ring"):
        run_of(scenario, "idm,density=300,duration=30")


def test_agents_of_the_file_stay_unless_they_are_left_out():
    scenario = road(
        300.0, cars=[Car(3, 150.0, velocity=10.0)], problems=[problem(9, 30.0, goal=(250.0, 0.0), time_step=(50, 400))]
    )
    both = run_of(scenario, "idm,rate=600,duration=10", agents="all")
    assert [agent.origin for agent in both.agents if agent.id == 9] == ["planning problem"]
    alone = run_of(scenario, "idm,rate=600,duration=10")
    assert not {3, 9} & set(alone.states.participant_id.tolist())


def test_a_run_folder_keeps_the_demand_and_repeats(tmp_path):
    run = run_of(road(300.0), "idm,rate=600,duration=10")
    run.save(tmp_path / "run")
    again = idr.load(tmp_path / "run")
    np.testing.assert_array_equal(again.demand.entered, run.demand.entered)
    assert again.demand.kind == run.demand.kind
    assert lane_flows(again) == pytest.approx(lane_flows(run), nan_ok=True) or repr(lane_flows(again)) == repr(
        lane_flows(run)
    )
    assert "planner" in run.settings
    assert run.settings["settings"]["traffic.rate"] == 600.0


def test_turning_shares_decide_at_forks():
    turns = {}
    for share in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
        made = Simulation(
            "t_junction", agents=0, traffic={"rate": 900.0, "turn": share, "mix": (1, 0, 0)}, threads=1
        ).traffic
        ends = {exit_id for lane, exit_id in zip(made.lane_ids, made.exit_ids, strict=True) if lane == 1}
        turns[share] = ends
    # From lanelet 1 the ways lead straight on to 4 and to the right to 6; there is none to the left.
    assert turns[1, 0, 0] == {4}
    assert turns[0, 0, 1] == {6}


def test_nobody_drives_around_a_ring_twice():
    # A ring of four lanelets, with a straight road that leads in at its beginning and one that leads out at its end.
    lanelets = ring(4, 30.0)
    ids = [*lanelets.ids.tolist(), 11, 12]
    roads = [np.linspace(begin, begin + 80.0, 20) for begin in (-80.0, 0.0)]
    left, right = ([np.column_stack([np.full(20, x), y]) for y in roads] for x in (28.25, 31.75))
    none = np.full(6, -1)
    after = [*lanelets.successors, (int(ids[0]),), ()]
    after[3] = (*after[3], 12)
    made = replace(
        lanelets,
        ids=np.array(ids),
        left=(*lanelets.left, *left),
        right=(*lanelets.right, *right),
        successors=tuple(after),
        predecessors=tuple(tuple(n for n, follows in zip(ids, after, strict=True) if one in follows) for one in ids),
        adjacent_left=none,
        adjacent_left_same_direction=none > 0,
        adjacent_right=none,
        adjacent_right_same_direction=none > 0,
        speed_limit=np.full(6, 8.0),
        types=((),) * 6,
    )
    graph = graph_of(world(made, steps=0))
    first, last = ids[0], ids[3]
    assert {way for way, _ in graph.ways(last)} == {first, 12}
    assert graph.leads_back(first, [11, *ids[:4]])
    assert not graph.leads_back(12, [11, *ids[:4]])
    assert not graph.leads_back(first, [11])


def graph_of(scenario):
    road = core_road(scenario, idr.SimulationSettings().road)
    return LaneGraph(scenario.lanelets, road, MapEnds(scenario, road))


def test_a_lane_that_begins_within_the_map_is_no_entry():
    lanelets = straight_road(200.0, 2)
    before = replace(lanelets, predecessors=((), ()), successors=((), ()))
    graph = graph_of(world(before, steps=0))
    assert graph.entries == (1, 2)
    assert graph.exits == {1, 2}


def lanes_after(*spans):
    """Lanelets on the x axis, each from one x to another [m]; none leads to the next."""
    whole = straight_road(300.0, 1)
    lines = [(np.linspace(begin, end, 20), np.sign(end - begin) * 1.75) for begin, end in spans]
    none = np.full(len(spans), -1)
    return replace(
        whole,
        ids=np.arange(1, len(spans) + 1),
        left=tuple(np.column_stack([x, np.full(20, half)]) for x, half in lines),
        right=tuple(np.column_stack([x, np.full(20, -half)]) for x, half in lines),
        predecessors=((),) * len(spans),
        successors=((),) * len(spans),
        adjacent_left=none,
        adjacent_left_same_direction=none > 0,
        adjacent_right=none,
        adjacent_right_same_direction=none > 0,
        speed_limit=np.full(len(spans), 13.9),
        types=((),) * len(spans),
    )


def test_a_lane_that_ends_before_more_of_the_map_is_no_exit_and_no_entry_leads_to_it():
    graph = graph_of(world(lanes_after((0.0, 100.0), (120.0, 300.0)), steps=0))
    assert graph.exits == {2}
    assert graph.entries == (2,)


def test_where_no_lane_leads_out_of_the_map_all_ends_are_exits():
    towards_each_other = lanes_after((0.0, 100.0), (220.0, 120.0))
    assert graph_of(world(towards_each_other, steps=0)).exits == {1, 2}


def test_routes_are_computed_once_for_a_map_whatever_was_made_before():
    scenario, settings = road(300.0, lanes=1), idr.SimulationSettings()
    traffic = idr.TrafficSettings(rate=900.0, duration=30.0, density=0.0, mix=(1.0, 0.0, 0.0))

    def maker():
        return TrafficMaker(scenario, core_road(scenario, settings.road), traffic, settings.step)

    used = maker()
    first, second = used.made(1, ()), used.made(2, ())
    assert len({id(agent.route) for agent in (*first.agents, *second.agents)}) == 1
    alone = maker().made(2, ())
    for made, other in zip(second.agents, alone.agents, strict=True):
        assert made.initial_state == other.initial_state
        np.testing.assert_array_equal(made.route.reference_path, other.route.reference_path)


@pytest.mark.parametrize(
    ("traffic", "text"),
    [
        ("rates=[99:600]", "traffic.rates: lanelet 99 is no entry of tiny; entries are 1, 2"),
        ("planner=idm", "traffic: there is none: give a rate or a density"),
        ("recorded,rate=600", "traffic.planner: recorded follows recordings"),
        ("nothing,rate=600", "traffic.planner: unknown planner 'nothing'"),
        ("rat=600", "traffic: rat: no such setting; did you mean rate?"),
    ],
)
def test_bad_traffic_gives_one_line(traffic, text):
    with pytest.raises(idr.InputError) as refused:
        run_of(road(300.0), traffic)
    assert text in str(refused.value)


def test_traffic_that_lasts_longer_than_the_run_may_is_refused_in_one_line():
    with pytest.raises(idr.InputError) as refused:
        run_of(road(300.0), "rate=600,duration=60", **{"step.max_steps": 500})
    assert "traffic.duration: 60 s are 600 time steps, but runs end after 500" in str(refused.value)
