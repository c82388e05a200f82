import dataclasses

import numpy as np
import pytest
from lanes import AGENT, behind_a_standing_car, drive_along, first_view, travelled, westwards

import interdrive as idr
from interdrive.planners.frenetix import Frenetix
from interdrive.testing import check_planner, straight_road

T_JUNCTION = "t_junction/ZAM_Tjunction-1_42_T-1.xml"
MERGE = "merge/ZAM_Zip-1_56_T-1.xml"
HIGHWAY = "highway/USA_US101-23_1_T-1.xml"


def test_frenetix_drives_all_five_agents_of_the_t_junction_to_their_goals(driven, ends):
    assert ends(driven(T_JUNCTION, "frenetix"))["goal_reached"] >= 4


def test_frenetix_drives_all_four_agents_of_the_merge_to_their_goals(driven, ends):
    assert ends(driven(MERGE, "frenetix"))["goal_reached"] >= 3


def test_frenetix_drives_two_agents_of_a_dense_highway_to_their_goals(driven, ends):
    assert ends(driven(HIGHWAY, "frenetix"))["goal_reached"] == 2


def test_frenetix_drives_the_same_in_processes_of_its_own(driven, scenarios_folder):
    again = idr.simulate(scenarios_folder / MERGE, planner="frenetix", threads=2)
    assert again.digest == driven(MERGE, "frenetix").digest


def test_frenetix_keeps_the_contract_of_planners():
    ends = check_planner(Frenetix, seconds_max=10.0)
    assert set(ends.values()) == {"goal_reached"}


def test_frenetix_stops_behind_a_standing_car_in_a_single_lane_if_it_knows_its_true_acceleration():
    planner = Frenetix(carry_state=False)
    run = idr.simulate(behind_a_standing_car(), agents=[AGENT], planner=planner, threads=1)
    assert run.outcomes.outcome[0] == "time_limit"
    assert 40.0 < travelled(run).max() < 55.5  # 60 m less the length of the cars


def test_frenetix_as_published_rolls_into_a_standing_car_at_walking_pace():
    # The library states half of its accelerations, and its planner begins the next plan with them: every plan brakes
    # later than the one before had promised (docs/reference/planners_third_party.md).
    run = idr.simulate(behind_a_standing_car(), agents=[AGENT], planner="frenetix", threads=1)
    assert run.outcomes.outcome[0] == "collision"
    assert 0.0 < run.outcomes.impact_speed[0] < 1.5


@pytest.mark.parametrize(("level", "samples"), [(0, 48), (1, 180), (2, 800), (3, 3564), (4, 12716)])
def test_the_samples_are_as_many_as_published(level, samples):
    view, _ = first_view(drive_along(straight_road(300.0), 30.0, 0.0, 100.0))
    rows = Frenetix(level=level).samples(view, np.array([30.0, 10.1, 0.2, 0.1, 0.0, 0.0]))
    assert rows.shape == (samples, 13)
    assert len(np.unique(rows, axis=0)) == samples


def test_a_road_that_leads_west_is_driven_like_one_that_leads_east():
    east = idr.simulate(drive_along(straight_road(300.0), 30.0, 0.0, 130.0), planner="frenetix", threads=1)
    west = idr.simulate(drive_along(westwards(300.0), 270.0, np.pi, 170.0), planner="frenetix", threads=1)
    assert east.outcomes.outcome == west.outcomes.outcome == ("goal_reached",)
    assert np.allclose(travelled(east), travelled(west), atol=1e-6)


def test_the_cheapest_free_sample_is_driven():
    view, predictions = first_view(behind_a_standing_car())
    planner = Frenetix()
    plan = planner.plan(view, predictions)
    all_else_equal = dataclasses.replace(planner, prediction_margin_length=60.0)
    assert view.first_contact(plan.x, plan.y, plan.orientation, predictions, 0.5, 0.2) is None
    assert view.on_road(plan.x, plan.y, plan.orientation)
    # An agent that must not come near the car ahead at all has to brake harder.
    assert all_else_equal.plan(view, predictions).velocity[-1] < plan.velocity[-1] - 1.0


def test_between_two_plans_the_first_one_is_followed_exactly():
    run = idr.simulate(drive_along(straight_road(300.0), 30.0, 0.0, 130.0), planner=Frenetix(replan_every=3), threads=1)
    steps, x = run.plans.time_step, run.plans.x
    assert np.array_equal(x[steps == 3][0, 1:29], x[steps == 4][0, :28])
    assert not np.array_equal(x[steps == 2][0, 1:28], x[steps == 3][0, :27])


def test_settings_out_of_range_are_refused_by_name():
    with pytest.raises(idr.InputError, match="planner frenetix: level: must be at least 0 and at most 4"):
        idr.Simulation("t_junction", agents=1, planner="frenetix,level=7")
