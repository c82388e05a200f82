"""Different planners from different makers on one road."""

from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main

T_JUNCTION = "t_junction/ZAM_Tjunction-1_42_T-1.xml"
MIXED = {1: "frenetix", 4: "reactive", 5: "idm", 7: "frenetix,level=1", 60000: "frenet"}


def test_frenet_frenetix_reactive_and_idm_cross_one_junction_without_contact(scenarios_folder, ends):
    run = idr.simulate(scenarios_folder / T_JUNCTION, planner=MIXED, threads=1, on_planner_error="raise")
    assert run.outcomes.planner == tuple(choice.partition(",")[0] for choice in MIXED.values())
    assert ends(run)["goal_reached"] >= 3
    other_order = dict(reversed(MIXED.items()))
    assert idr.simulate(scenarios_folder / T_JUNCTION, planner=other_order, threads=2).digest == run.digest


def test_a_run_with_a_third_party_planner_can_be_verified(scenarios_folder, tmp_path):
    scenario, out = str(scenarios_folder / "highway/USA_US101-23_1_T-1.xml"), str(tmp_path / "run")
    options = ["--agents", "44", "--agent", "44=frenetix,level=1", "--out", out]
    done = CliRunner().invoke(main, ["run", scenario, *options])
    assert done.exit_code == 0, done.output
    verified = CliRunner().invoke(main, ["verify", out])
    assert verified.exit_code == 0, verified.output
