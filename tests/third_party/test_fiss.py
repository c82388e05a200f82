import pytest
from lanes import AGENT, behind_a_standing_car, drive_along, travelled

import interdrive as idr
from interdrive.planners.fiss import METHODS, Fiss
from interdrive.testing import check_planner, straight_road

T_JUNCTION = "t_junction/ZAM_Tjunction-1_42_T-1.xml"


def test_fiss_drives_most_agents_of_the_t_junction_to_their_goals(driven, ends):
    assert ends(driven(T_JUNCTION, "fiss"))["goal_reached"] >= 4


def test_fiss_drives_the_zip_merge_without_contact(driven, ends):
    ends(driven("merge/ZAM_Zip-1_56_T-1.xml", "fiss"))


def test_fiss_drives_the_same_again_and_with_two_threads():
    scenario = drive_along(straight_road(300.0), 30.0, 0.0, 80.0)
    one, two = (idr.simulate(scenario, planner="fiss", threads=threads) for threads in (1, 2))
    assert one.outcomes.outcome == ("goal_reached",)
    assert one.digest == two.digest


@pytest.mark.parametrize("method", METHODS)
def test_every_search_of_fiss_reaches_a_goal_on_a_free_road(method):
    scenario = drive_along(straight_road(300.0), 30.0, 0.0, 80.0)
    run = idr.simulate(scenario, planner=f"fiss,method={method}", threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


def test_fiss_keeps_the_contract_of_planners_and_stops_at_red_lights():
    ends = check_planner(Fiss, seconds_max=10.0)
    assert set(ends.values()) <= {"goal_reached", "goal_reached_late"}


def test_fiss_stops_behind_a_standing_car_in_a_single_lane():
    run = idr.simulate(behind_a_standing_car(), agents=[AGENT], planner=Fiss(), threads=1)
    assert run.outcomes.outcome[0] == "time_limit"
    assert 40.0 < travelled(run).max() < 55.5  # 60 m less the length of the cars


def test_a_search_that_fiss_does_not_know_is_refused_by_name():
    with pytest.raises(idr.InputError, match="planner fiss: method must be one of fop, fop_plus, fiss, fiss_plus"):
        idr.Simulation("t_junction", agents=1, planner="fiss,method=astar")
