import pytest
from lanes import AGENT, behind_a_standing_car, drive_along, travelled

import interdrive as idr
from interdrive.planners.reactive import Reactive
from interdrive.testing import check_planner, straight_road

T_JUNCTION = "t_junction/ZAM_Tjunction-1_42_T-1.xml"
MERGE = "merge/ZAM_Merge-1_1_T-1.xml"
HIGHWAY = "highway/USA_US101-23_1_T-1.xml"


def test_reactive_drives_all_five_agents_of_the_t_junction_to_their_goals(driven, ends):
    assert ends(driven(T_JUNCTION, "reactive"))["goal_reached"] >= 4


def test_reactive_with_its_coarsest_samples_drives_the_merge_without_contact(driven, ends):
    ends(driven(MERGE, "reactive,level=1"))


def test_reactive_drives_two_agents_of_a_dense_highway_to_their_goals(driven, ends):
    assert ends(driven(HIGHWAY, "reactive"))["goal_reached"] == 2


def test_reactive_drives_the_same_in_a_process_of_its_own():
    scenario = drive_along(straight_road(300.0), 30.0, 0.0, 80.0)
    one, two = (idr.simulate(scenario, planner="reactive", threads=threads) for threads in (1, 2))
    assert one.outcomes.outcome == ("goal_reached",)
    assert one.digest == two.digest


def test_reactive_keeps_the_contract_of_planners():
    ends = check_planner(lambda: Reactive(level=1, horizon=2.0), seconds_max=10.0)
    assert set(ends.values()) <= {"goal_reached", "goal_reached_late"}


def test_reactive_stops_behind_a_standing_car_in_a_single_lane():
    run = idr.simulate(behind_a_standing_car(), agents=[AGENT], planner=Reactive(level=1), threads=1)
    assert run.outcomes.outcome[0] == "time_limit"
    assert 40.0 < travelled(run).max() < 55.5  # 60 m less the length of the cars


def test_reactive_starts_at_once_at_the_edge_of_the_road():
    scenario = drive_along(straight_road(300.0), 30.0, 0.0, 130.0, y=0.93)
    run = idr.simulate(scenario, planner="reactive", threads=1)
    assert run.outcomes.outcome[0] == "goal_reached"
    assert travelled(run)[5] > 4.0


def test_settings_out_of_range_are_refused_by_name():
    with pytest.raises(idr.InputError, match="planner reactive: level: must be at least 1 and at most 3"):
        idr.Simulation("t_junction", agents=1, planner="reactive,level=7")
