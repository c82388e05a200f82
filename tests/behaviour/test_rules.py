"""Rules of the road, obeyed and broken: a straight road along x with a stop line at x = 100 m; steps of 0.1 s."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.support import commonroad_documents as cr
from tests.support.drivers import Straight

import interdrive as idr
from interdrive.files import read_scenario
from interdrive.report.contents import run_contents

#: Half the length of a car [m].
HALF = 2.25


def road(tmp_path, *, phases=(("red", 5000),), more="", content="", limit=None, speed=10.0, x=50.0, goal=(0, 160)):
    """A car at `x` [m] that wants to get to x = 130 to 150 m; by default the light stays red."""
    refs = '<trafficLightRef ref="7"/>' if phases else ""
    limited = "" if limit is None else '<trafficSignRef ref="6"/>'
    lanelets = cr.lanelet(1, more='<successor ref="2"/>' + limited + refs + more) + cr.lanelet(
        2, left=((100, 2), (200, 2)), right=((100, -2), (200, -2)), more='<predecessor ref="1"/>' + limited
    )
    light = cr.traffic_light(7, *phases) if phases else ""
    signs = "" if limit is None else cr.speed_sign(6, limit)
    start = cr.initial(x, velocity=speed, yawRate=0.0, slipAngle=0.0)
    area = cr.rectangle_at(140, 0, length=20, width=4)
    problem = cr.planning_problem(50, cr.goal(position=area, time=goal), start=start)
    return read_scenario(cr.saved(tmp_path, cr.document(signs + light + content + problem, lanelets=lanelets)))


def front(run):
    """x of the front of the agent over time [m]."""
    return run.states.x[0, run.states.valid[0]] + HALF


def broken(run):
    """Rules that the agent broke."""
    return [rule for rule, source in zip(run.violations.rule, run.violations.source, strict=True) if source == "agent"]


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_a_red_light_holds_and_a_green_one_lets_go(tmp_path, planner):
    run = idr.simulate(road(tmp_path, phases=(("red", 120), ("green", 5000))), planner=planner, threads=1)
    x = front(run)
    assert 97.0 <= x[119] <= 100.0, "it stands before the line while the light is red"
    assert abs(run.states.velocity[0, 119]) < 0.3
    assert run.outcomes.outcome[0].startswith("goal_reached"), "it drives on"
    assert broken(run) == []


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_without_the_rule_the_red_light_is_run_and_the_violation_is_recorded(tmp_path, planner):
    run = idr.simulate(road(tmp_path), planner=planner, settings={"rules.lights": False}, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert broken(run) == ["red_light"]
    passed = int(np.argmax(front(run) >= 100.0))
    assert run.violations.first_time_step[0] == passed
    assert run.violations.value[0] == pytest.approx(0.1 * passed), "red since the first time step [s]"


@pytest.mark.parametrize("agents_see_lights", [True, False])
def test_an_agent_whose_time_is_over_at_a_red_light_says_so(tmp_path, agents_see_lights):
    run = idr.simulate(road(tmp_path, goal=(0, 60)), settings={"rules.lights": agents_see_lights}, threads=1)
    assert (" at a red light (stop line of lanelet 1)" in run.outcomes.reason[0]) == agents_see_lights


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_an_agent_stands_before_a_light_that_stays_red(tmp_path, planner):
    run = idr.simulate(road(tmp_path, goal=(0, 200)), planner=planner, threads=1)
    assert 99.0 < front(run).max() < 100.0, "m"
    assert run.states.velocity[0, run.states.valid[0]][-1] == 0.0
    assert broken(run) == []


@pytest.mark.parametrize("ahead", [102.5, 104.0, 106.0])
@pytest.mark.parametrize("y", [1.0, -1.0])
def test_an_agent_that_waits_at_a_red_light_does_not_back_out_from_behind_what_stands_beyond(tmp_path, ahead, y):
    parked = cr.car(9, cr.initial(ahead + 2.25, y, velocity=0.0), [cr.state(k, ahead + 2.25, y) for k in range(1, 300)])
    scenario = road(tmp_path, phases=(("red", 250), ("green", 5000)), content=parked, goal=(0, 450))
    run = idr.simulate(scenario, agents=[50], threads=1)
    velocity = run.states.velocity[np.searchsorted(run.states.participant_id, 50)]
    assert velocity[:250].min() > -0.01, "m/s"


@pytest.mark.parametrize(("metres", "passes"), [(30.0, False), (29.0, True)])
def test_at_a_limit_of_30_mph_an_agent_stops_for_yellow_30_m_before_the_line_but_not_29_m(tmp_path, metres, passes):
    # Stopping takes 3.0 or 3.1 m/s².
    start = {"x": 100.0 - metres - HALF, "speed": 13.41, "goal": (0, 100)}
    run = idr.simulate(road(tmp_path, phases=(("yellow", 30), ("red", 5000)), **start), threads=1)
    assert front(run).max() > 130.0 if passes else 99.0 < front(run).max() < 100.0, "m"
    assert broken(run) == []


def test_an_agent_too_near_to_stop_for_yellow_goes_on_although_it_slows_down_for_the_limit(tmp_path):
    # It enters 27 m before the line with 14 m/s, where stopping takes 3.6 m/s², and slows down to the limit of 10 m/s.
    start = {"x": 100.0 - 27.0 - HALF, "speed": 14.0, "limit": 10.0, "goal": (0, 100)}
    run = idr.simulate(road(tmp_path, phases=(("yellow", 30), ("red", 5000)), **start), threads=1)
    velocity = run.states.velocity[0, run.states.valid[0]]
    assert front(run).max() > 130.0, "m"
    assert velocity.min() > 9.0 and np.diff(velocity).min() > -0.6, "m/s, per step"
    assert broken(run) == []


@pytest.mark.parametrize(("x", "passes"), [(84.0, True), (75.0, False)])
def test_an_agent_stops_for_yellow_if_it_is_not_too_near(tmp_path, x, passes):
    # After the first step its front is 12.75 m before the line, so that stopping takes 3.9 m/s²; or 21.75 m, 2.3 m/s².
    phases = (("green", 1), ("yellow", 10), ("red", 5000))
    run = idr.simulate(road(tmp_path, phases=phases, x=x, goal=(0, 60)), planner="idm", threads=1)
    assert (front(run).max() > 100.0) == passes
    assert broken(run) == []


def test_at_a_stop_sign_the_agent_stands_for_a_second_and_goes_on(tmp_path):
    scenario = road(tmp_path, phases=(), more='<trafficSignRef ref="8"/>', content=cr.sign(8, "206"))
    run = idr.simulate(scenario, threads=1)
    x, speed = front(run), run.states.velocity[0, run.states.valid[0]]
    stands = (speed <= 0.1) & (x >= 98.0) & (x <= 100.0)
    assert 10 <= stands.sum() <= 15, "time steps"
    assert run.outcomes.outcome == ("goal_reached",)
    assert broken(run) == []
    free = idr.simulate(scenario, threads=1, settings={"rules.stop_signs": False})
    assert broken(free) == ["stop_sign"]


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_the_speed_limit_is_kept_even_if_the_goal_would_need_more(tmp_path, planner):
    # 85 m in 6 s would need 14 m/s.
    run = idr.simulate(road(tmp_path, phases=(), limit=10.0, goal=(0, 60)), planner=planner, threads=1)
    assert run.states.velocity[0, run.states.valid[0]].max() < 10.5
    assert broken(run) == []


def test_an_agent_that_starts_too_fast_brakes_at_once_and_is_not_speeding(tmp_path):
    run = idr.simulate(road(tmp_path, phases=(), limit=10.0, speed=15.0, x=5.0), threads=1)
    velocity = run.states.velocity[0, run.states.valid[0]]
    too_fast = velocity[:-1] > 10.5
    assert (-np.diff(velocity)[too_fast] / 0.1).min() >= 1.0, "m/s²"
    assert 10 < too_fast.sum() < 20 and velocity[20:].max() < 10.5, "time steps, m/s"
    assert broken(run) == []


@pytest.mark.parametrize(("speed", "seconds", "hardest"), [(11.0, 0.6, 1.5), (12.4, 1.1, 3.0), (15.0, 2.0, 3.0)])
def test_an_agent_above_the_limit_is_within_half_a_metre_per_second_of_it_soon(tmp_path, speed, seconds, hardest):
    # From 15 m/s, 3 m/s² alone would take 1.5 s.
    run = idr.simulate(road(tmp_path, phases=(), limit=10.0, speed=speed, x=5.0), threads=1)
    velocity = run.states.velocity[0, run.states.valid[0]]
    assert (velocity[int(10 * seconds) : 60] <= 10.5).all()
    assert (velocity[:60] > 9.0).all(), "and it hardly falls below the limit"
    assert -np.diff(velocity[:30]).min() / 0.1 < hardest, "m/s²"
    assert broken(run) == []


def test_an_agent_is_as_slow_as_a_lower_limit_where_that_begins(tmp_path):
    # 13.9 m/s up to x = 100 m, 8.3 m/s beyond; the centre of the car counts.
    scenario = road(tmp_path, phases=(), limit=13.8889, speed=13.8889, x=10.0)
    lanelets = replace(scenario.lanelets, speed_limit=np.array([13.8889, 8.3333]))
    run = idr.simulate(replace(scenario, lanelets=lanelets), threads=1)
    x, velocity = (values[0, run.states.valid[0]] for values in (run.states.x, run.states.velocity))
    assert velocity[x > 100.0].max() <= 8.3333 + 0.7, "m/s, for less time than counts as speeding"
    assert velocity[x > 110.0].max() < 8.4, "m/s"
    assert broken(run) == []


def test_one_agent_may_break_rules_that_the_others_obey(tmp_path):
    scenario = road(tmp_path)
    choice = {"50": {"rules.enabled": False}}
    run = idr.simulate(scenario, agents="all", planner=choice, threads=1)
    assert broken(run) == ["red_light"]
    own = run.settings["rules"]
    assert [table["enabled"] for table in own.values()] == [False], "run.json says which agent obeys which rules"
    again = idr.simulate(scenario, planner=run.settings["planner"], rules=own, threads=1)
    assert again.digest == run.digest


class _Obeys(Straight):
    """Brakes for what the view says must not be passed; keeps its speed otherwise."""

    def plan(self, view, predictions):
        ego, n = view.ego, 31
        room = ego.stop_s - (ego.s + ego.vehicle.rear_axle_to_center + 0.5 * ego.vehicle.length) - 0.5
        time = np.arange(n) * view.dt
        braking = ego.velocity**2 / (2 * room) if 0 < room < ego.velocity**2 / 4 else (9.0 if room <= 0 else 0.0)
        velocity = np.maximum(ego.velocity - braking * time, 0.0)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * view.dt)])
        heading = np.full(n, ego.orientation)
        return idr.Trajectory(ego.x + way, np.full(n, ego.y), heading, velocity)


def test_a_planner_in_python_sees_what_holds_it_and_how_fast_it_may_go(tmp_path):
    seen = []

    class Looks(_Obeys):
        def plan(self, view, predictions):
            seen.append((view.ego.stop_s, view.ego.speed_limit))
            return super().plan(view, predictions)

    scenario = road(tmp_path, phases=(("red", 120), ("green", 5000)), limit=10.0)
    run = idr.simulate(scenario, planner=Looks, threads=1)
    assert 98.0 < front(run)[119] <= 100.0
    stops = np.array([stop for stop, _ in seen])
    assert np.isfinite(stops[:120]).all() and np.isinf(stops[120:]).all()
    limits = seen[0][1]
    assert limits.shape == (len(run.agents[0].reference_path),)
    assert set(limits[:100].tolist()) == {10.0}


def test_recorded_drivers_are_judged_like_agents(tmp_path):
    def drive(number, y, speed, n):
        states = [cr.state(t, 40.0 + 0.1 * speed * t, y, orientation=0.0, velocity=speed) for t in range(1, n)]
        return cr.car(number, cr.initial(40.0, y, velocity=speed), states)

    scenario = road(tmp_path, content=drive(30, 0.5, 12.0, 80), limit=10.0, x=20.0)
    run = idr.simulate(scenario, agents=[50], threads=1)
    found = run.violations
    rows = list(zip(found.source, found.participant_id.tolist(), found.rule, strict=True))
    assert ("replayed", 30, "red_light") in rows
    assert ("replayed", 30, "speeding") in rows
    place = rows.index(("replayed", 30, "speeding"))
    assert found.value[place] == pytest.approx(2.0), "m/s above the limit"
    as_agent = idr.simulate(scenario, agents=[30], threads=1).violations
    sources = set(zip(as_agent.source, as_agent.rule, strict=True))
    assert {("recording", "red_light"), ("recording", "speeding")} <= sources
    assert ("agent", "red_light") not in sources


def rows(run):
    """Which agent broke which rule, and by how much."""
    found = run.violations
    return list(zip(found.source, found.rule, found.value.tolist(), strict=True))


def test_a_drive_above_the_limit_is_one_row_with_the_largest_excess(tmp_path):
    run = idr.simulate(road(tmp_path, phases=(), limit=10.0, speed=12.0), planner=Straight, threads=1)
    assert rows(run) == [("agent", "speeding", pytest.approx(2.0, abs=0.1))], "m/s"


def test_a_drive_past_a_stop_sign_is_one_row_with_the_least_speed(tmp_path):
    sign = {"more": '<trafficSignRef ref="8"/>', "content": cr.sign(8, "206")}
    run = idr.simulate(road(tmp_path, phases=(), speed=7.0, **sign), planner=Straight, threads=1)
    assert rows(run) == [("agent", "stop_sign", pytest.approx(7.0, abs=0.1))], "m/s"


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_a_lawful_drive_past_a_light_a_stop_sign_and_a_limit_has_no_row(tmp_path, planner):
    sign = {"more": '<trafficSignRef ref="8"/>', "content": cr.sign(8, "206")}
    scenario = road(tmp_path, phases=(("red", 80), ("green", 5000)), limit=8.0, speed=8.0, goal=(0, 300), **sign)
    run = idr.simulate(scenario, planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert rows(run) == []


def test_violations_are_saved_and_loaded(tmp_path):
    run = idr.simulate(road(tmp_path), settings={"rules.lights": False}, threads=1)
    again = idr.Run.load(run.save(tmp_path / "run"))
    assert again.violations.to_arrow().equals(run.violations.to_arrow())
    assert again.violations.to_pandas()["rule"].tolist() == ["red_light"]
    without = idr.simulate(road(tmp_path), settings={"record.violations": False}, threads=1)
    assert without.violations is None
    assert not (without.save(tmp_path / "none") / "violations.parquet").exists()


def test_driving_against_the_lane_for_a_second_is_a_violation(tmp_path):
    turned = cr.car(
        30,
        cr.initial(80.0, -1.0, orientation=float(np.pi), velocity=5.0),
        [cr.state(t, 80.0 - 0.5 * t, -1.0, orientation=float(np.pi), velocity=5.0) for t in range(1, 25)],
    )
    scenario = road(tmp_path, phases=(), x=90.0, content=turned)
    run = idr.simulate(scenario, agents=[50], planner=Straight, threads=1)
    assert rows(run) == [("replayed", "wrong_way", pytest.approx(12.5, abs=0.1))], "metres"


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_at_the_shipped_junction_with_lights_none_pass_on_red_and_all_arrive(planner):
    run = idr.simulate("signals", planner=planner)
    assert broken(run) == []
    assert all(outcome.startswith("goal_reached") for outcome in run.outcomes.outcome)
    assert run.digest == idr.simulate("signals", planner=planner, threads=1).digest


def test_at_the_shipped_junction_recorded_drivers_obey_and_agents_without_rules_do_not():
    run = idr.simulate("signals", predictor="constant_velocity", settings={"rules.enabled": False})
    rows = set(zip(run.violations.source, run.violations.rule, strict=True))
    assert ("agent", "red_light") in rows
    assert {source for source, _ in rows} == {"agent"}


def test_the_page_of_a_run_has_its_stop_lines_and_an_event_for_each_violation(tmp_path):
    run = idr.simulate(road(tmp_path), settings={"rules.lights": False}, threads=1)
    header = run_contents(run.save(tmp_path / "run")).header
    assert [event["text"] for event in header["events"] if event["kind"] == "violation"] == [
        f"50 passes a light that has been red for {run.violations.value[0]:.1f}\N{NO-BREAK SPACE}s"
    ]
    assert header["arrays"]["stop_line_xy"]["shape"] == [1, 4]
    assert header["arrays"]["stop_line_signal"]["shape"] == [1, run.states.n_steps]
