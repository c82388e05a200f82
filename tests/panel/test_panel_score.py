"""Scores against a panel, in tiny worlds: what drivers reach in an agent's place, and what others lose by it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.errors import InputError
from interdrive.panel import PANEL, World
from interdrive.scenario import StopLine, TrafficLight
from interdrive.scoring import score as absolute_score
from interdrive.scoring import score_table
from interdrive.scoring.tables import COLUMNS
from interdrive.testing import Car, problem, straight_road, world

#: A goal that asks for 12 m/s over 180 m.
IN_TIME = (0, 150)


class Constant:
    """Keeps its heading and accelerates by a rate, down to standing."""

    rate = 0.0

    def plan(self, view, predictions):
        speed = np.maximum(view.ego.velocity + self.rate * view.dt * np.arange(31), 0.0)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * view.dt)])
        x = view.ego.x + way * math.cos(view.ego.orientation)
        y = view.ego.y + way * math.sin(view.ego.orientation)
        return idr.Trajectory(x, y, np.full(31, view.ego.orientation), speed)


class Halt(Constant):
    """Brakes with 4 m/s² and stands."""

    rate = -4.0


class Broken:
    """Raises."""

    def plan(self, view, predictions):
        raise RuntimeError("no plan today")


def road(*cars, velocity=12.0, limit=13.0, lanes=1, y=0.0, time_step=IN_TIME, steps=150):
    """A road of 500 m along x with agent 100, which starts at 80 m and has its goal at 260 m."""
    lanelets = straight_road(500.0, lanes=lanes)
    lanelets = replace(lanelets, speed_limit=np.full_like(lanelets.speed_limit, limit))
    agent = problem(100, 80.0, y, velocity, goal=(260.0, y), time_step=time_step)
    return world(lanelets, cars=cars, problems=[agent], steps=steps)


def drive(scenario, planner, others=(), traffic="idm", **options):
    return idr.simulate(
        scenario,
        agents=[100, *others],
        planner={100: planner, "default": traffic} if others else planner,
        predictor="constant_velocity",
        threads=1,
        **options,
    )


def test_the_panel_itself_gets_everything_in_time():
    scenario = road()
    for name in PANEL:
        found = idr.score(drive(scenario, name), panel="default")
        assert found.score.tolist() == [1.0], name
        assert found.why(100) == "full score"
        assert found.panel == PANEL


def test_without_anybody_who_reacts_nothing_is_known_of_hindrance():
    alone, among_replays = drive(road(), "idm"), drive(road(Car(7, 20.0, velocity=10.0)), "idm")
    for run in (alone, among_replays):
        assert math.isnan(idr.score(run).totals[0].hindrance)


def test_who_is_late_gets_the_share_of_the_second_fastest_driver():
    scenario = road(velocity=8.0, limit=12.0)
    found = idr.score(drive(scenario, Constant), panel="default")
    facts, total = found.facts[0], found.totals[0]
    assert facts.arrived
    assert not facts.in_time
    assert facts.duration == pytest.approx(175.0 / 8.0, abs=0.3), "s"
    assert total.yard == pytest.approx(sorted(facts.panel_times)[1])
    assert total.pace == pytest.approx(max(total.yard, facts.free_flow) / facts.duration)
    assert total.score == total.pace
    assert 0.6 < total.pace < 0.8
    assert found.why(100).startswith(f"pace {total.pace:.2f}: {facts.duration:.1f} s for 175 m, where ")


def test_who_stands_gets_next_to_nothing_and_reads_where_it_stood():
    found = idr.score(drive(road(), Halt), panel="default")
    assert found.score[0] < 0.06
    assert found.totals[0].arrival == 0.5
    assert "; stood 2" in found.why(100)
    assert ", longest at 18 m" in found.why(100), "12² / (2 · 4) m"
    assert "did not arrive, where lawful, idm, idm_mobil and rollout did (counts half)" in found.why(100)


def test_a_halt_before_a_follower_forces_it_to_brake():
    # 1.5 s behind at 15 m/s, 4.5 m long.
    scenario = road(Car(7, 80.0 - 22.5 - 4.5, velocity=15.0), velocity=15.0, limit=15.0)
    found = idr.score(drive(scenario, Halt, others=[7]), [100])
    assert found.facts[0].forced
    assert found.totals[0].hindrance == 0.0
    assert "hindrance 0: 7 braked with" in found.why(100)
    assert found.facts[0].lost > 5.0, "vehicle seconds"
    honest = idr.score(drive(scenario, "idm", others=[7]), [100])
    assert not honest.facts[0].forced
    assert honest.totals[0].hindrance > 0.9


def test_who_stands_off_everybodys_way_takes_nothing_from_others():
    scenario = road(Car(7, 40.0, velocity=15.0), velocity=0.0, lanes=2, y=3.5)
    found = idr.score(drive(scenario, Halt, others=[7]), [100])
    assert found.facts[0].lost == 0.0
    assert found.totals[0].hindrance == 1.0


def test_a_red_light_is_a_zero_without_any_collision():
    line = StopLine(1, np.array([[150.0, 1.75], [150.0, -1.75]]), ((1, (5,)),))
    scenario = replace(road(), traffic_lights=(TrafficLight(5, (("red", 900), ("green", 100))),), stop_lines=(line,))
    found = idr.score(drive(scenario, Constant), panel="default")
    assert found.facts[0].gates == {"red_light": 0.0}
    assert found.score[0] == 0.0
    assert found.why(100) == "passed a red light at 5.7 s"
    # Free flow waits, too: it has as long as the light is red.
    assert found.facts[0].free_flow > 85.0, "s"


def test_somebody_hit_from_behind_is_judged_as_if_it_stood_from_then_on():
    scenario = road(Car(7, 40.0, velocity=20.0))
    found = idr.score(drive(scenario, Constant), panel="default")
    facts = found.facts[0]
    assert "fault" not in facts.gates
    assert facts.duration == pytest.approx(1.7 * 15.0), "s"
    assert 0.0 < found.score[0] < 0.5
    assert "hit by 7 at 4.5 s, not its fault: counts as standing from then on" in found.why(100)


def test_what_stands_is_not_said_to_have_hit_the_agent():
    # 7.5 m ahead at 12 m/s there is no room to brake, so that it is no fault.
    found = idr.score(drive(road(Car(7, 92.0)), Constant), panel="none")
    assert "fault" not in found.facts[0].gates
    assert "ran into 7, which stood, at " in found.why(100)
    assert "hit by" not in found.why(100)


def test_a_broken_planner_gets_nothing():
    found = idr.score(drive(road(), Broken), panel="default")
    assert found.score[0] == 0.0
    assert found.why(100).startswith("planner_error: ")


def test_without_a_panel_free_flow_is_the_yardstick_and_nothing_is_excused():
    found = idr.score(drive(road(velocity=6.0, limit=12.0), Constant), panel="none")
    total, facts = found.totals[0], found.facts[0]
    assert math.isnan(total.yard)
    assert total.pace == pytest.approx(facts.free_flow / facts.duration)
    assert total.excused == ()
    assert f"free flow takes {facts.free_flow:.1f} s" in found.why(100)


def test_what_no_driver_of_the_panel_can_help_is_excused():
    # A wall stands 7 m ahead: nobody can keep 0.95 s to it.
    scenario = road(Car(7, 91.0), velocity=12.0, steps=400)
    found = idr.score(drive(scenario, "idm"), panel="default")
    assert max(found.facts[0].panel_ttc) == 0.0
    assert "ttc" in found.totals[0].excused


def test_the_world_without_an_agent_has_everybody_else_as_before():
    scenario = road(Car(7, 20.0, velocity=10.0), Car(8, 140.0, velocity=10.0))
    run = drive(scenario, "idm", others=[7])
    without = World.of(run, 100).without_agent()
    assert without.states.participant_id.tolist() == [7, 8]
    row, own = (int(np.searchsorted(one.states.participant_id, 8)) for one in (run, without))
    n = min(run.states.x.shape[1], without.states.x.shape[1])
    assert np.array_equal(run.states.x[row, :n], without.states.x[own, :n], equal_nan=True)


def test_in_its_own_place_a_driver_repeats_its_run_to_the_bit():
    run = drive(road(Car(7, 20.0, velocity=10.0)), "rollout", others=[7])
    assert World.of(run, 100).driven_by("rollout").digest == run.digest


def test_of_several_agents_nothing_is_said_about_what_they_take_from_others():
    run = drive(road(Car(7, 20.0, velocity=10.0)), "idm", others=[7])
    found = idr.score(run, panel=["idm"])
    assert found.ids.tolist() == [7, 100]
    assert np.isnan(found.terms["hindrance"]).all()
    assert "several agents are scored" in found.notes[0]


def test_one_agent_is_scored_against_the_panel_and_several_are_scored_alone():
    run = drive(road(Car(7, 20.0, velocity=10.0)), "idm", others=[7])
    assert idr.score(run, [100]).panel == PANEL
    alone = idr.score(run)
    assert alone.panel == ()
    assert alone.score.tobytes() == absolute_score(run).score.tobytes() == idr.score(run, panel="none").score.tobytes()
    assert alone.score[1] == idr.score(run, [100], panel="none").score[0]


def test_a_run_that_nothing_can_repeat_is_scored_alone_unless_a_panel_is_asked_for():
    run = replace(drive(road(), "idm"), settings={})
    assert idr.score(run).panel == ()
    with pytest.raises(InputError, match="does not say how to repeat it"):
        idr.score(run, panel="default")


def test_without_a_list_of_violations_scores_say_that_none_count():
    line = StopLine(1, np.array([[150.0, 1.75], [150.0, -1.75]]), ((1, (5,)),))
    scenario = replace(road(), traffic_lights=(TrafficLight(5, (("red", 900), ("green", 100))),), stop_lines=(line,))
    found = idr.score(replace(drive(scenario, Constant), violations=None), panel="none")
    assert found.terms["gate_red_light"].tolist() == [1.0]
    assert found.notes == ("violations were not recorded: lights, signs, crosswalks and right of way do not count",)


def test_the_table_has_every_column():
    table = score_table(idr.score(drive(road(), Halt), panel="none"))
    assert table.column_names == [column.name for column in COLUMNS]
    assert table["in_time"].to_pylist() == [False]
    assert table["forced"].to_pylist() == [None], "nobody can react"


def test_a_world_that_fails_without_the_agent_is_told_and_costs_nothing(monkeypatch):
    def fails(world):
        raise InputError(f"nobody is left without {world.agent_id}")

    run = drive(road(Car(7, 20.0, velocity=10.0)), "idm", others=[7])
    monkeypatch.setattr(World, "without_agent", fails)
    found = idr.score(run, [100], panel=["idm"])
    assert math.isnan(found.totals[0].hindrance)
    assert found.score[0] == 1.0
    assert any(
        note == "what others lose is not measured: the world without 100 fails (nobody is left without 100)"
        for note in found.notes
    ), found.notes


def test_a_scenario_that_has_changed_since_the_run_takes_no_panel(tmp_path):
    file = tmp_path / "moved.xml"
    file.write_bytes(idr.shipped_scenario("t_junction").read_bytes())
    saved = idr.simulate(file, agents=[2001], planner="idm", predictor="constant_velocity", threads=1)
    folder = saved.save(tmp_path / "run")
    file.write_text(file.read_text().replace('timeStepSize="0.1"', 'timeStepSize="0.2"'))
    found = idr.load(folder)
    assert idr.score(found, [2001]).panel == (), "absolute unless a panel is asked for"
    with pytest.raises(InputError, match="the scenario file is gone or has changed"):
        idr.score(found, [2001], panel="default")


def test_bad_input_is_refused_in_one_line():
    run = drive(road(), "idm")
    with pytest.raises(InputError, match="score: 5 is not an agent of this run"):
        idr.score(run, [5])
    bare = replace(run, agents=(replace(run.agents[0], reference_path=np.empty((0, 2))),))
    with pytest.raises(InputError, match="the run has no route of agent 100"):
        idr.score(bare)
    with pytest.raises(InputError, match="nowhere: not a stored panel"):
        idr.score(run, panel="nowhere")
    both = drive(road(Car(7, 20.0, velocity=10.0)), "idm", others=[7], traffic=Constant)
    with pytest.raises(InputError, match=r"(imports code outside|Python object)"):
        idr.score(both, [100], panel="default")
