"""The step loop: what agents see, what is recorded, and that the same run has the same bits."""

from dataclasses import replace

import numpy as np
import pytest
from drivers import Straight

from interdrive import Frenet, InputError, Simulation, SimulationSettings, simulate
from interdrive.config.binding import bind
from interdrive.config.schema import RecordSettings
from interdrive.errors import StepOrderError
from interdrive.planners import FrenetWeights
from interdrive.predictors import Neural
from interdrive.run import PHASES
from interdrive.run.assemble import digest
from interdrive.runs import RunInterrupted
from interdrive.testing import Car, problem, straight_road, world


def two_lanes(**options):
    problems = [
        problem(100, 20.0, goal=(90.0, 0.0), time_step=(0, 90)),
        problem(200, 12.0, 3.5, velocity=12.0, goal=(110.0, 3.5), time_step=(0, 90)),
    ]
    cars = [Car(7, 60.0, velocity=6.0), Car(9, 150.0, 3.5, velocity=3.0, first=4)]
    return world(straight_road(300.0, lanes=2), cars=cars, problems=problems, **options)


class Looking(Straight):
    """Remembers what it saw."""

    def __init__(self):
        self.views = []

    def plan(self, view, predictions):
        self.views.append((view, predictions))
        return super().plan(view, predictions)


def looks(settings=None):
    looking = Looking()
    planner = {100: lambda: looking, "default": "rollout"}
    run = simulate(two_lanes(), agents=[100, 200], planner=planner, settings=settings, threads=1)
    return looking.views, run


def test_a_view_holds_the_past_of_those_in_sight_and_nothing_else():
    views, run = looks()
    view, _ = views[5]
    assert view.time_step == 5
    assert view.ids.tolist() == [7, 200]  # 9 entered at step 4, 122 m away
    assert view.x.shape == (2, 31)
    assert np.isnan(view.x[:, :25]).all()  # before the beginning
    assert np.array_equal(view.x[:, 25:], run.states.x[[0, 3], :6])


def test_a_view_does_not_change_afterwards_and_cannot_be_written():
    views, _ = looks()
    view, _ = views[3]
    assert view.x[0, -1] == pytest.approx(60.0 + 3 * 0.6)
    with pytest.raises(ValueError, match="read-only"):
        view.x[0, 0] = 1.0


def test_a_smaller_sensor_radius_shows_fewer():
    views, _ = looks(bind(SimulationSettings(), {"view.sensor_radius": 20.0}))
    assert views[0][0].ids.tolist() == [200]


def test_predictions_are_of_now_and_for_those_in_sight_and_oneself():
    views, _ = looks()
    view, predictions = views[5]
    assert predictions.time_step == 5
    assert predictions.ids.tolist() == sorted([*view.ids.tolist(), 100])
    n_modes = Neural().modes_max + 1  # the wide one
    assert predictions.covariance.shape == (len(predictions.ids), n_modes, 30, 2, 2)


@pytest.mark.parametrize(("dt", "steps"), [(0.1, 30), (0.2, 30), (0.04, 75), (0.05, 60)])
def test_the_past_that_is_shown_lasts_three_seconds_however_short_the_steps_are(dt, steps):
    scenario = world(
        straight_road(), problems=[problem(100, 20.0, velocity=5.0, goal=(110.0, 0.0), time_step=(80, 400))], dt=dt
    )
    assert Simulation(scenario, threads=1).world.scene().x.shape[1] == steps + 1


def test_a_plan_that_ends_before_the_next_is_due_is_replaced_in_time():
    run = simulate(two_lanes(), settings=bind(SimulationSettings(), {"step.replan_every": 500}), threads=1)
    row = run.states.participant_id.tolist().index(200)
    there = run.states.valid[row]
    moved = np.hypot(np.diff(run.states.x[row, there]), np.diff(run.states.y[row, there])) / 0.1
    assert moved == pytest.approx(run.states.velocity[row, there][1:], abs=0.3)


def test_every_agent_and_every_run_has_its_own_copy_of_a_planner():
    class Counting(Straight):
        calls = 0

        def plan(self, view, predictions):
            self.calls += 1
            assert self.calls == view.time_step + 1
            return super().plan(view, predictions)

    simulation = Simulation(two_lanes(), agents=[100, 200], planner=Counting(), threads=1)
    assert "planner_error" not in simulation.run().outcomes.outcome
    simulation.reset()
    assert "planner_error" not in simulation.run().outcomes.outcome


def test_a_record_as_planner_is_stored_with_its_settings():
    stored = simulate(two_lanes(), planner=Frenet(level=0), threads=1).settings
    assert stored["planner"] == {"planner": "frenet", "level": 0}
    assert stored["repeatable"]


def test_after_the_end_nothing_happens():
    simulation = Simulation(two_lanes(), threads=1)
    first = simulation.run().digest
    simulation.step()
    assert simulation.record().digest == first


def test_records_on_the_way_and_at_the_end_have_all_plans_however_often_they_are_made():
    simulation = Simulation(two_lanes(), agents=[100], planner="idm", threads=1, settings={"step.max_steps": 6})
    for _ in range(3):
        simulation.step()
    halfway = simulation.record().plans
    while not simulation.is_done:
        simulation.step()
    ends = [simulation.record().plans for _ in range(2)]
    assert halfway.time_step.tolist() == [0, 1, 2]
    for end in ends:
        assert end.time_step.tolist() == [0, 1, 2, 3, 4, 5]
        np.testing.assert_array_equal(end.x[:3], halfway.x)
        np.testing.assert_array_equal(end.x, ends[0].x)


def test_arrays_of_a_scenario_cannot_be_written():
    with pytest.raises(ValueError, match="read-only"):
        two_lanes().obstacles.x[0, 0] = 1.0


def test_the_phases_of_a_step_are_all_timed():
    run = simulate(two_lanes(), threads=1)
    n_steps = run.states.n_steps - 1
    assert run.timings.phase == PHASES * n_steps
    assert run.timings.time_step.tolist() == np.repeat(np.arange(n_steps), len(PHASES)).tolist()
    assert (run.timings.seconds >= 0).all()


def test_the_time_that_the_core_works_is_part_of_the_time_of_the_phases():
    simulation = Simulation(two_lanes(), threads=1)
    assert simulation.world.native_seconds == 0.0
    simulation.step()
    first = simulation.world.native_seconds
    run = simulation.run()
    assert 0.0 < first < simulation.world.native_seconds < run.timings.seconds.sum()
    collision = run.timings.seconds[[phase == "collision" for phase in run.timings.phase]]
    assert (collision > 0.0).all()


def test_a_plan_is_recorded_for_every_agent_and_step_and_is_what_was_driven():
    run = simulate(two_lanes(), agents=[100, 200], threads=1)
    own = run.plans.agent_id == 200
    row = run.states.participant_id.tolist().index(200)
    assert run.plans.time_step[own].tolist() == list(range(run.outcomes.time_step[1]))
    assert np.array_equal(run.plans.x[own, 1], run.states.x[row, 1 : own.sum() + 1])


@pytest.mark.parametrize("change", [{"threads": 2}, {"threads": 8}, {"agents": [200, 100]}])
def test_the_same_run_has_the_same_bits(change):
    options = {"agents": [100, 200], "threads": 1}
    assert simulate(two_lanes(), **options).digest == simulate(two_lanes(), **(options | change)).digest


def test_all_candidates_of_a_plan_can_be_recorded_with_their_reasons():
    settings = SimulationSettings(record=RecordSettings(candidates=10_000))
    simulation = Simulation(two_lanes(), agents=[200], planner="frenet", settings=settings, threads=1)
    simulation.step()
    kept = simulation.record().candidates
    # 8 end times, 10 end speeds and 9 offsets (the present one, 0, is on the grid); stops and braking come on top.
    assert len(kept.cost) >= 720
    assert {kept.rejection[row] for row in np.flatnonzero(kept.chosen)} == {""}
    assert any(kept.rejection)


def test_the_digest_tells_one_bit():
    states = simulate(two_lanes(), threads=1).states
    x = states.x.copy()
    x[0, 3] = np.nextafter(x[0, 3], np.inf)
    changed = replace(states, x=x)
    assert digest(changed) != digest(states)


def test_reset_begins_anew():
    simulation = Simulation(two_lanes(), threads=1)
    first = simulation.run().digest
    simulation.reset()
    assert simulation.time_step == 0
    assert simulation.run().digest == first


def test_replanning_every_third_step_follows_the_plan_in_between():
    settings = bind(SimulationSettings(), {"step.replan_every": 3})
    run = simulate(two_lanes(), agents=[100, 200], settings=settings, threads=1)
    own = np.flatnonzero(run.plans.agent_id == 200)
    first, second = run.plans.x[own[0]], run.plans.x[own[1]]
    assert np.array_equal(first[1:], second[:-1])
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"agents": [5]}, "agent 5: no such vehicle; possible agents: 100, 200, 7, 9"),
        ({"agents": 8}, "8 agents requested, but only"),
        ({"agents": -1}, "the number of agents must be at least"),
        ({"agents": "some"}, "'all', 'reachable', 'problems', a number or ids"),
        ({"planner": "frenett"}, "unknown planner 'frenett': did you mean frenet?"),
        ({"planner": "nowhere:Planner"}, "module nowhere cannot be imported"),
        ({"planner": "interdrive.testing:Nothing"}, "module interdrive.testing has no Nothing"),
        ({"planner": object()}, "is not a planner"),
        ({"planner": {55: "frenet"}}, "agent 55"),
        ({"predictor": "lane_folowing"}, "did you mean lane_following?"),
        ({"predictor": 3}, "is not a predictor"),
        ({"seed": -1}, "the seed must be from 0 to 2^64 - 1, is -1"),
        ({"seed": 2**64}, "the seed must be from 0 to 2^64 - 1"),
    ],
)
def test_an_impossible_wish_is_refused_in_one_line(options, words):
    with pytest.raises(InputError) as caught:
        simulate(two_lanes(), threads=1, **options)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_scene_of_another_world_is_refused():
    one, other = (Simulation(two_lanes(), agents=[100], threads=1).world for _ in range(2))
    with pytest.raises(InputError, match="the scene is of another world"):
        one.view(other.scene(), 100)


def test_predictions_of_another_time_step_are_refused():
    views, _ = looks()
    (_, first), (second, _) = views[:2]
    with pytest.raises(StepOrderError, match="predictions"):
        first.seen_by(second)


def test_points_that_lack_a_coordinate_are_refused():
    views, _ = looks()
    with pytest.raises(InputError, match="x and y must have one length, not 2 and 1"):
        views[0][0].ego.route.project(np.array([1.0, 2.0]), np.array([0.0]))


@pytest.mark.parametrize(
    ("options", "location", "message"),
    [
        ({"weights": FrenetWeights(jerk="much")}, "weights.jerk", "expected a number, not much"),
        ({"weights": FrenetWeights(jerk=-1.0)}, "weights.jerk", "must not be negative"),
        ({"weights": "much"}, "weights", "expected settings, not much"),
    ],
)
def test_an_error_in_settings_within_settings_names_both(options, location, message):
    with pytest.raises(InputError) as caught:
        Frenet(**options)
    assert caught.value.location == location
    assert caught.value.message.startswith(message)


def test_a_number_larger_than_that_of_the_possible_agents_is_an_id():
    assert [agent.id for agent in Simulation("t_junction", agents=2001).agents] == [2001]
    assert len(Simulation("t_junction", agents=2).agents) == 2


def test_ctrl_c_between_a_step_and_the_note_of_its_times_loses_neither(monkeypatch):
    simulation = Simulation(two_lanes(), threads=1)

    def interrupted(_step):
        monkeypatch.undo()
        raise KeyboardInterrupt

    monkeypatch.setattr(simulation.progress.logs, "end", interrupted)
    with pytest.raises(RunInterrupted) as stopped:
        simulation.run()
    run = stopped.value.run
    assert run.states.n_steps == 2
    assert set(run.timings.time_step.tolist()) == {0}
