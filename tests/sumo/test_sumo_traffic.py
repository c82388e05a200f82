"""Agents among vehicles of SUMO."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from appearances import too_near

import interdrive as idr
from interdrive.errors import InterdriveError
from interdrive.planners import Trajectory
from interdrive.scenario import KINDS
from interdrive.simulation import Simulation
from interdrive.sumo.traffic import Traffic


class Stands:
    """Stays where it is."""

    def plan(self, view, predictions):
        ego = view.ego
        n = 30
        same = [np.full(n, value) for value in (ego.x, ego.y, ego.orientation)]
        return Trajectory(*same, velocity=np.zeros(n))


def standing(folder, x, *, velocity=0.0):
    """The scenario with its problem at a place on the road from west to east."""
    scenario = idr.read_source(folder)
    problem = scenario.planning_problems[0]
    start = replace(problem.initial_state, x=x, velocity=velocity)
    return replace(scenario, planning_problems=(replace(problem, initial_state=start),))


def rows_of(run, name):
    """Row of the participant that SUMO calls so."""
    number = run.sumo.participant_id[run.sumo.name.index(name)]
    return int(np.searchsorted(run.states.participant_id, number))


@pytest.fixture(scope="module")
def cologne(published):
    return idr.simulate(published / "DEU_Cologne-63_5_I-1", threads=1)


def test_the_vehicles_are_as_many_as_published(published):
    # The published run, made with SUMO 1.9, has 31, 33, 32, 29 and 26 after 3, 6, 9, 12 and 15 s.
    scenario = idr.read_source(published / "DEU_Cologne-63_5_I-1")
    traffic = Traffic(scenario, [], np.inf, 0)
    counts = [len(traffic.first(0)[1])]
    for step in range(150):
        counts.append(len(traffic.step(step, [], np.empty((0, 6)))[1]))
    traffic.close()
    assert np.abs(np.array(counts)[[30, 60, 90, 120, 150]] - [31, 33, 32, 29, 26]).max() <= 2


def test_vehicles_of_sumo_drive_alone_to_the_end_of_the_scenario(published):
    run = idr.simulate(published / "DEU_Cologne-63_5_I-1", agents=0, threads=1, settings={"sumo.radius": 1.0})
    counts = run.states.valid.sum(axis=0)
    assert (len(run.agents), len(counts), run.finished) == (0, 151, True)
    assert np.abs(counts[[30, 60, 90, 120, 150]] - [31, 33, 32, 29, 26]).max() <= 2


def test_nobody_is_in_the_world_twice_and_no_id_repeats(cologne):
    ids, names = cologne.states.participant_id, cologne.sumo.name
    assert len(set(ids.tolist())) == len(ids)
    assert len(set(names)) == len(names)
    assert not any(name.startswith(("interdrive", "egoVehicle")) for name in names)
    x, y, valid = cologne.states.x, cologne.states.y, cologne.states.valid
    for step in range(cologne.states.n_steps):
        there = np.flatnonzero(valid[:, step])
        places = np.round(np.stack([x[there, step], y[there, step]], axis=1), 2)
        assert len(np.unique(places, axis=0)) == len(there)


def test_vehicles_move_as_fast_as_they_say(cologne):
    states = cologne.states
    both = states.valid[:, 1:] & states.valid[:, :-1]
    way = np.hypot(np.diff(states.x, axis=1), np.diff(states.y, axis=1))[both]
    fast = 0.1 * np.maximum(states.velocity[:, 1:], states.velocity[:, :-1])[both]
    assert np.quantile(way - fast, 0.99) < 0.1, "m per step"


def test_nobody_of_sumo_appears_right_ahead_of_an_agent(cologne):
    agents = {agent.id for agent in cologne.agents}
    appearances = too_near(cologne.states)
    # Among themselves, vehicles of SUMO depart by its own gaps, which count the speed of who is ahead.
    assert not [one for one in appearances if one.behind in agents]
    assert all(one.gap > 5.0 for one in appearances), "m"


def test_a_run_is_the_same_with_more_threads_and_again_and_another_with_another_seed(published, cologne):
    folder = published / "DEU_Cologne-63_5_I-1"
    first = Simulation(folder, threads=1)
    second = Simulation(folder, threads=2)  # both at once
    while not (first.is_done and second.is_done):
        first.step()
        second.step()
    assert first.record().digest == second.record().digest == cologne.digest
    other = idr.simulate(folder, threads=1, seed=1)
    assert other.sumo is not None
    assert other.digest != cologne.digest


@pytest.mark.parametrize("planner", ["rollout", "frenet"])
def test_published_problems_are_driven_without_a_collision(published, planner):
    runs = [
        idr.simulate(folder, planner=planner, predictor="lane_following", threads=1)
        for folder in sorted(published.iterdir())
    ]
    ends = [run.outcomes.outcome[0] for run in runs]
    assert "collision" not in ends
    assert ends.count("goal_reached") >= 3


def test_a_follower_of_sumo_stops_behind_an_agent_that_stands(crossing):
    # The first vehicle enters 75 m behind the agent with up to 13.9 m/s.
    run = idr.simulate(standing(crossing, -40.0), planner=Stands, settings={"step.max_steps": 150}, threads=1)
    agent = int(np.searchsorted(run.states.participant_id, 900))
    behind = rows_of(run, "west_east.0")
    gap = run.states.x[agent] - run.states.x[behind] - 0.5 * (run.states.length[agent] + run.states.length[behind])
    near, slow = np.flatnonzero(gap < 45.0)[0], np.flatnonzero(run.states.velocity[behind] < 0.5)[0]
    assert 0.1 * (slow - near) < 8.0, "s from 45 m behind the agent to 0.5 m/s"
    # SUMO's least gap is 2.5 m.
    assert 0.2 < gap[run.states.valid[behind]][-1] < 2.6, "m"
    assert run.outcomes.outcome == ("time_limit",), "nobody hits it"


def test_the_agent_and_sumo_see_the_same_lights(crossing):
    run = idr.simulate(crossing, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert not [rule for rule in run.violations.rule if rule == "red_light"]
    agent = int(np.searchsorted(run.states.participant_id, 900))
    # Red until 45 s: it stands before its line, vehicles of SUMO in the same lane behind it.
    assert run.states.velocity[agent, 400] < 0.1
    before = (run.states.x[:, 400] < -7.0) & (np.abs(run.states.y[:, 400] + 1.6) < 0.5) & run.states.valid[:, 400]
    assert np.count_nonzero(before) >= 4
    assert np.nanmax(run.states.x[before, 400]) == run.states.x[agent, 400]


def test_lights_of_sumo_count_for_agents_where_the_file_has_none(crossing):
    text = (crossing / "crossing.cr.xml").read_text()
    text = re.sub(r"<trafficLightRef[^>]*/>|<trafficLight id.*?</trafficLight>", "", text, flags=re.DOTALL)
    (crossing / "crossing.cr.xml").write_text(text)
    scenario = idr.read_source(crossing)
    assert any("obeyed by agents, too" in note for note in scenario.notes)
    run = idr.simulate(scenario, threads=1)
    agent = int(np.searchsorted(run.states.participant_id, 900))
    assert run.states.velocity[agent, 400] < 0.1, "red until 45 s"
    assert run.outcomes.outcome == ("goal_reached",)


def post_encroachment(run):
    """Times between agent 900, which goes east, and those that go north or south, in their shared square [s]."""
    states, found = run.states, []
    agent = int(np.searchsorted(states.participant_id, 900))
    half = 0.5 * states.length, 0.5 * states.width
    for row, there in enumerate(states.valid):
        if row == agent or not there.any() or np.abs(np.sin(states.orientation[row][there])).min() < 0.9:
            continue
        x, y = np.median(states.x[row][there]), np.median(states.y[agent][states.valid[agent]])
        theirs = np.flatnonzero(there & (np.abs(states.y[row] - y) < half[0][row] + half[1][agent]))
        own = np.flatnonzero(states.valid[agent] & (np.abs(states.x[agent] - x) < half[0][agent] + half[1][row]))
        if len(theirs) and len(own):
            found.append(0.1 * max(own[0] - theirs[-1], theirs[0] - own[-1]))
    return found


def test_nobody_ignores_anybody_at_a_crossing_without_lights(equal_crossing):
    least = []
    for seed in range(10):
        run = idr.simulate(equal_crossing, predictor="lane_following", seed=seed, threads=1)
        assert run.outcomes.outcome == ("goal_reached",)
        least += [min(post_encroachment(run))]
    # Once, a driver of SUMO who has to give way goes 0.8 s before the agent: by its own gap, which is in time.
    assert sorted(least)[1] >= 1.0, "s"
    assert min(least) >= 0.75, "s"


def test_an_agent_that_stands_for_two_minutes_stays_in_sumo_and_is_gone_when_it_has_ended(crossing):
    simulation = Simulation(standing(crossing, -40.0), threads=1)
    traffic = Traffic(simulation.scenario, simulation.agents, np.inf, 0)
    traffic.first(0)
    state = np.array([[-40.0, -1.6, 0.0, 0.0, 0.0, 0.0]])

    def behind(outside):
        """Speed of the first vehicle in its lane [m/s]."""
        _, ids, states, _ = outside
        return states[[traffic.names[number] for number in ids].index("west_east.0"), 3]

    for step in range(1200):
        there = traffic.step(step, [900], state)
    assert behind(there) < 0.1
    for step in range(1200, 1240):
        there = traffic.step(step, [], np.empty((0, 6)))
    assert behind(there) > 3.0
    traffic.close()


def entering_late(folder, time_step):
    """The scenario with its problem that many time steps later."""
    scenario = idr.read_source(folder)
    problem = scenario.planning_problems[0]
    start = replace(problem.initial_state, time_step=time_step)
    first, last = problem.goal[0].time_step
    goal = tuple(replace(one, time_step=(first + time_step, last + time_step)) for one in problem.goal)
    return replace(scenario, planning_problems=(replace(problem, initial_state=start, goal=goal),))


def test_nobody_vanishes_when_the_only_agent_enters(crossing):
    scenario = entering_late(crossing, 60)
    run = idr.simulate(scenario, predictor="lane_following", threads=1, settings={"step.max_steps": 80})
    there = run.states.valid[np.searchsorted(run.states.participant_id, run.sumo.participant_id)]
    assert there[:, 59].sum() >= 2
    assert (np.abs(np.diff(there.astype(int), axis=1)).sum(axis=1) <= 2).all(), "each comes and goes once"
    assert there[:, 60].sum() >= there[:, 59].sum() - 1


def test_nobody_vanishes_while_the_only_agent_waits_longer_than_stated(crossing):
    scenario = entering_late(crossing, 30)
    traffic = Traffic(scenario, Simulation(scenario, threads=1).agents, 300.0, 0)
    traffic.first(0)
    counts = [len(traffic.step(step, [], np.empty((0, 6)))[1]) for step in range(90)]
    traffic.close()
    assert min(counts[60:]) >= 2


def test_the_files_of_the_folder_stay_as_they_are(crossing):
    before = {file.name: file.read_bytes() for file in crossing.iterdir()}
    idr.simulate(standing(crossing, 80.0, velocity=5.0), threads=1)
    assert {file.name: file.read_bytes() for file in crossing.iterdir()} == before


def test_a_run_says_in_one_line_that_sumo_has_ended(crossing):
    simulation = Simulation(crossing, threads=1)
    simulation.step()
    child = simulation.progress.sumo._process._child
    os.kill(child.pid, signal.SIGKILL)
    begin = time.monotonic()
    with pytest.raises(InterdriveError, match=r"SUMO ended at time step 1: it said nothing \(exit code -9\)"):
        simulation.step()
    assert time.monotonic() - begin < 5.0, "s"


def test_no_process_is_left_when_the_run_is_killed(crossing, tmp_path):
    code = (
        f"import interdrive as idr\ns = idr.Simulation({str(crossing)!r}, threads=1)\n"
        "print(s.progress.sumo._process._child.pid, flush=True)\nwhile True: s.step()"
    )
    run = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    child = Path(f"/proc/{int(run.stdout.readline())}/status")
    run.kill()
    run.wait()
    deadline = time.monotonic() + 10.0
    while child.exists() and "zombie" not in child.read_text():
        assert time.monotonic() < deadline, "SUMO still runs"
        time.sleep(0.1)


def test_a_stored_run_is_repeated_and_another_version_is_refused(crossing, tmp_path):
    def command(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "interdrive", *arguments], cwd=tmp_path, capture_output=True, text=True, check=False
        )

    done = command("run", str(crossing), "--out", "made", "--quiet", "--threads", "1")
    assert done.returncode == 0, done.stderr
    found = idr.load(tmp_path / "made")
    assert found.sumo.name[0].startswith(("east_west", "north_south", "south", "west_east"))
    assert command("verify", "made").returncode == 0
    info = tmp_path / "made" / "run.json"
    text = json.loads(info.read_text())
    text["versions"]["libsumo"] = "1.0.0"
    info.write_text(json.dumps(text))
    refused = command("verify", "made")
    assert refused.returncode == 2
    assert "was made with SUMO 1.0.0" in refused.stderr


def test_an_exported_run_is_driven_by_sumo_with_the_agents_as_its_own_vehicles(crossing, tmp_path):
    run = idr.simulate(crossing, threads=1)
    run.save(tmp_path / "made")
    command = [sys.executable, "-m", "interdrive", "export", "made", "--sumo", "for_sumo"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    routes = (tmp_path / "for_sumo" / "agents.rou.xml").read_text()
    assert '<route edges="west_center center_east"' in routes
    with (tmp_path / "for_sumo" / "fcd.xml").open("rb") as file:
        steps = list(fromstring(file.read()))
    assert len(steps) == run.states.n_steps
    agent = next(one for one in steps[0] if one.get("id") == "900")
    # Front bumper, and degrees clockwise from north.
    assert float(agent.get("x")) == pytest.approx(-100.0 + 0.5 * run.states.length[0], abs=1e-3)
    assert (float(agent.get("angle")), float(agent.get("speed"))) == (90.0, 10.0)
    (crossing / "crossing.rou.xml").write_text(routes)
    again = Traffic(idr.read_source(crossing), [], np.inf, 0)
    _, ids, states, _ = again.step(0, [], np.empty((0, 6)))
    again.close()
    assert [again.names[number] for number in ids] == ["agent_900"]
    assert states[0, :2] == pytest.approx([-99.0, -1.6], abs=1.5)


def add(folder, text):
    file = folder / "crossing.rou.xml"
    file.write_text(file.read_text().replace("</routes>", f"{text}</routes>"))


#: A way and a walk from west to east.
ROUTE = '<route edges="west_center center_east"/>'


def alone(folder, text):
    """SUMO's participants among which nothing else drives."""
    (folder / "crossing.rou.xml").write_text(f"<routes>{text}</routes>")
    return Traffic(idr.read_source(folder), [], np.inf, 0)


def test_a_vehicle_and_a_person_of_the_same_name_are_two_participants(crossing):
    walk = '<person id="0" depart="0"><walk edges="west_center center_east" departPos="50"/></person>'
    vehicle = f'<vehicle id="0" depart="0">{ROUTE}</vehicle>'
    traffic = alone(crossing, vehicle + walk)
    new, *_ = traffic.step(0, [], np.empty((0, 6)))
    traffic.close()
    assert sorted(KINDS[kind] for _, kind, *_ in new) == ["car", "pedestrian"]
    assert min(length for *_, length, _ in new) == pytest.approx(0.478), "m, the larger of both sizes of a person"


def test_vehicles_that_agents_stand_in_for_are_never_there(crossing):
    slow = f'<vType id="slow" maxSpeed="2"/><vehicle id="egoVehicle1" type="slow" depart="1">{ROUTE}</vehicle>'
    traffic = alone(crossing, f'{slow}<vehicle id="b" depart="3" departSpeed="max">{ROUTE}</vehicle>')
    for step in range(80):
        there = traffic.step(step, [], np.empty((0, 6)))
    traffic.close()
    assert list(traffic.names.values()) == ["b"]
    assert there[2][0, 3] > 8.0, "m/s: nothing is ahead of it"


def test_agents_are_where_they_should_be_between_time_steps_too(crossing):
    for name, old, new in (("cr.xml", 'timeStepSize="0.1"', 'timeStepSize="0.2"'),):
        file = crossing / f"crossing.{name}"
        file.write_text(file.read_text().replace(old, new))
    run = idr.simulate(crossing, predictor="lane_following", threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert run.scenario.sumo.delta_steps == 2


def test_sumo_writes_nothing_outside_its_copy(crossing, tmp_path):
    written = tmp_path / "written.xml"
    config = crossing / "crossing.sumocfg"
    outputs = f'<report><log value="{written}"/></report><any><tripinfo-output value="{written}"/></any>'
    config.write_text(config.read_text().replace("</configuration>", f"{outputs}</configuration>"))
    idr.simulate(standing(crossing, 80.0, velocity=5.0), threads=1)
    assert not written.exists()


def test_an_agent_drives_where_sumo_would_not_let_it_and_with_a_name_that_is_taken(crossing):
    net = crossing / "crossing.net.xml"
    net.write_text(net.read_text().replace('<lane id="center_east_0"', '<lane id="center_east_0" allow="bus"'))
    (crossing / "crossing.rou.xml").write_text(
        '<routes><vehicle id="interdrive_agent_900" depart="0">'
        '<route edges="south_center center_north"/></vehicle></routes>'
    )
    run = idr.simulate(standing(crossing, 40.0, velocity=5.0), threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert run.sumo.name == ("interdrive_agent_900",)


def test_who_is_in_the_way_of_an_agent_that_enters_leaves_for_good(crossing):
    add(crossing, '<person id="p" depart="0"><walk edges="center_east" departPos="80"/></person>')
    first = Simulation(crossing, threads=1)
    first.step()
    x, y, *_ = first.progress.sumo._there["person", "p"]
    scenario = idr.read_source(crossing)
    problem = scenario.planning_problems[0]
    start = replace(problem.initial_state, x=x, y=y, velocity=0.0)
    scenario = replace(scenario, planning_problems=(replace(problem, initial_state=start),))
    later = Simulation(replace(scenario, sumo=replace(scenario.sumo, presimulation_steps=1)), threads=1)
    for _ in range(5):
        later.step()
    run = later.record()
    assert "SUMO's p left because agents entered where they were" in run.notes
    assert "p" not in run.sumo.name


def run_of(folder, here):
    command = [sys.executable, "-m", "interdrive", "run", str(folder), "--out", "made", "--quiet"]
    return subprocess.run(command, cwd=here, capture_output=True, text=True, check=False)


def test_the_command_ends_with_exit_code_1_when_sumo_ends(crossing, tmp_path):
    """A route to nowhere, which SUMO reads when it is due."""
    route, config = crossing / "crossing.rou.xml", crossing / "crossing.sumocfg"
    vehicle = '<vehicle id="{0}" depart="{0}"><route edges="west_center {1}"/></vehicle>'
    late = vehicle.format(3, "center_east") + vehicle.format(4, "nowhere")
    route.write_text(route.read_text().replace("</routes>", f"{late}</routes>"))
    config.write_text(config.read_text().replace("</input>", '<route-steps value="1"/></input>'))
    done = run_of(crossing, tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert done.stderr.startswith("error: SUMO ended at time step ")
    assert not (tmp_path / "made").exists()


def test_files_that_sumo_refuses_are_bad_input(crossing, tmp_path):
    route = crossing / "crossing.rou.xml"
    route.write_text(route.read_text().replace("west_center center_east", "west_center nowhere"))
    done = run_of(crossing, tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert done.stderr.startswith("error: crossing.sumocfg: SUMO refuses it: ")
    assert "nowhere" in done.stderr
    assert not (tmp_path / "made").exists()
