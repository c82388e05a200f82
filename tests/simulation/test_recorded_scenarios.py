"""The whole chain on recorded scenarios."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from interdrive import InputError, Simulation, read_scenario, save, simulate

#: Scenario and number of its vehicles that become agents; the rest of a big one replays, so that a run takes a second.
SOME = {
    "highway/USA_US101-3_3_T-1.xml": 13,
    "intersection/USA_Lanker-1_7_T-1.xml": 16,
    "t_junction/ZAM_Tjunction-1_42_T-1.xml": 5,
    "urban/DEU_Muc-13_1_T-1.xml": 8,
}
#: Half of the last digit that a CommonRoad file gets, and a little for rounding.
EIGHT_DECIMALS = 0.51e-8


@pytest.fixture(params=SOME)
def case(request, scenarios_folder):
    """A scenario and the ids of its agents."""
    scenario = read_scenario(scenarios_folder / request.param)
    ids = [agent.id for agent in Simulation(scenario, agents="all").agents]
    assert len(ids) >= SOME[request.param]
    return scenario, ids[: SOME[request.param]]


def test_a_run_has_the_same_bits_for_any_number_of_threads_and_any_order_of_agents(case):
    scenario, ids = case
    shuffled = np.random.default_rng(0).permutation(ids).tolist()
    assert shuffled != ids
    first = simulate(scenario, agents=ids, threads=1)
    for agents, threads in ((ids, 2), (ids, 8), (shuffled, 2)):
        again = simulate(scenario, agents=agents, threads=threads)
        assert again.digest == first.digest, (agents, threads)
        assert again.outcomes.outcome == first.outcomes.outcome


def with_another_future(scenario, after, ids):
    """The scenario in which those that are not in `ids` stand from the time step `after` on."""
    o = scenario.obstacles
    others = ~np.isin(o.ids, ids)
    changed = {name: getattr(o, name).copy() for name in ("x", "y", "orientation", "velocity", "acceleration")}
    for name, table in changed.items():
        standing = table[others, after, None] if name in ("x", "y", "orientation") else 0.0
        table[others, after + 1 :] = np.where(o.valid[others, after + 1 :], standing, np.nan)
    return replace(scenario, obstacles=replace(o, **changed))


@pytest.mark.parametrize("predictor", ["lane_following", "constant_velocity", "neural", "ground_truth"])
def test_nobody_knows_the_recorded_future(scenarios_folder, predictor):
    """Up to the step at which the futures part, nothing differs: neither what is driven nor what is planned."""
    scenario = read_scenario(scenarios_folder / "highway" / "USA_US101-3_3_T-1.xml")
    ids = [agent.id for agent in Simulation(scenario).agents][::2]
    after = 12
    known, changed = (
        simulate(one, agents=ids, predictor=predictor) for one in (scenario, with_another_future(scenario, after, ids))
    )

    def same(name):
        a, b = getattr(known.states, name)[:, : after + 1], getattr(changed.states, name)[:, : after + 1]
        return np.array_equal(a, b, equal_nan=True)

    def planned(run):
        return run.plans.x[run.plans.time_step <= after]

    assert not np.array_equal(known.states.x[:, after + 1], changed.states.x[:, after + 1], equal_nan=True)
    alike = all(map(same, ("x", "y", "orientation", "velocity", "valid")))
    alike = alike and np.array_equal(planned(known), planned(changed), equal_nan=True)
    assert alike == (predictor != "ground_truth")


def test_t_junctions_are_driven_well(recorded_scenarios):
    ends = Counter()
    contacts = []
    for path, scenario in recorded_scenarios.items():
        if path.startswith("t_junction/"):
            outcomes = simulate(scenario).outcomes
            ends.update(outcomes.outcome)
            is_partner = np.isin(outcomes.partner_id, outcomes.agent_id)
            contacts += [(path, int(i)) for i in outcomes.agent_id[is_partner]]
    assert ends.total() == 38
    assert contacts == []
    assert ends["goal_reached"] >= 0.9 * ends.total(), ends


def test_every_recorded_scenario_takes_its_first_steps_or_is_refused_in_one_line(recorded_scenarios):
    refused = {}
    for path, scenario in recorded_scenarios.items():
        if isinstance(scenario, InputError):
            continue
        try:
            simulation = Simulation(scenario)
        except InputError as error:
            refused[path] = str(error)
            continue
        for _ in range(3):
            if not simulation.is_done:
                simulation.step()
        run = simulation.record()
        assert "planner_error" not in run.outcomes.outcome, (path, run.outcomes.message)
        assert run.states.valid.any()
    assert all("\n" not in message for message in refused.values())
    assert {path.removeprefix("format_edge_cases/").removesuffix(".xml") for path in refused} == {
        "DEU_Starnberg-1_1_T-1",  # no traffic, no planning problem
        "ZAM_Loading_Bay-1_1_T",  # its goal lies on no lanelet
        "ZAM_Tutorial-1_1_T-1",  # no way leads to its goal
        "test_3d_points",  # no traffic, no planning problem
        "test_reading_intersection_traffic_sign",  # starts off the road
        "test_reading_lanelets",  # no traffic, no planning problem
    }


@pytest.mark.parametrize("path", ["t_junction/ZAM_Tjunction-1_42_T-1.xml", "vulnerable/RUS_Bicycle-3_1_T-1.xml"])
def test_a_written_run_is_what_was_driven_for_us_and_for_commonroad_io(scenarios_folder, tmp_path, path):
    from commonroad.common.file_reader import CommonRoadFileReader

    run = simulate(scenarios_folder / path)
    file = save(run, tmp_path / "run") / "scenario.xml"
    ours = read_scenario(file).obstacles
    rows = [ours.ids.tolist().index(i) for i in run.states.participant_id]
    n_steps = run.states.n_steps
    for name in ("x", "y", "orientation", "velocity"):
        difference = getattr(ours, name)[rows, :n_steps] - getattr(run.states, name)
        if name == "orientation":
            difference -= np.round(difference / (2 * np.pi)) * 2 * np.pi  # files have headings within half a turn
        assert np.array_equal(np.isnan(difference), ~run.states.valid)
        assert np.nanmax(np.abs(difference)) < EIGHT_DECIMALS, name
    theirs, problems = CommonRoadFileReader(file).open()
    assert len(problems.planning_problem_dict) == len(run.scenario.planning_problems) == 1
    for row, number in enumerate(run.states.participant_id.tolist()):
        obstacle = theirs.obstacle_by_id(number)
        for step in np.flatnonzero(run.states.valid[row]).tolist():
            driven = (run.states.x[row, step], run.states.y[row, step])
            assert obstacle.state_at_time(step).position == pytest.approx(driven, rel=0, abs=EIGHT_DECIMALS)
