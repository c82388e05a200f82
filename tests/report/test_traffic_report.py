"""Flow, speed and queue of generated traffic on the page of a run."""

from dataclasses import replace

import numpy as np
import pytest

from interdrive.report.contents import run_contents
from interdrive.results import save
from interdrive.run.flow_profiles import flow_profiles, window_edges
from interdrive.run.flows import lane_flows
from interdrive.simulation import simulate
from interdrive.testing import Car, problem, straight_road, world

FAST = {"record.violations": False, "record.orders": False}


@pytest.fixture(scope="module")
def run():
    """One lane that ends before a parked car, so that vehicles queue."""
    lanelets = straight_road(300.0)
    scenario = world(replace(lanelets, speed_limit=np.full(1, 15.0)), cars=[Car(7, 60.0, velocity=0.0)], steps=1)
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, is_static=np.array([True])))
    settings = {**FAST, "rules.passing": False, "step.max_steps": 600}
    return simulate(
        scenario,
        agents=0,
        traffic="idm,rate=1500,duration=60,density=0",
        predictor="lane_following",
        settings=settings,
        threads=1,
    )


def test_windows_add_up_to_what_the_table_says(run):
    rows = lane_flows(run)
    edges = window_edges(run)
    assert edges[0] == 0.0
    assert edges[-1] == pytest.approx(60.0)
    assert np.diff(edges).min() >= 0.01 * np.diff(edges).max()
    for row, profile in zip(rows, flow_profiles(run, rows, edges), strict=True):
        vehicles = (profile.flow * np.diff(edges) / 3600.0).sum()
        assert vehicles == pytest.approx(row.vehicles, abs=1e-9)
    entry = next(row for row in rows if row.side == "in")
    queue = flow_profiles(run, rows, edges)[rows.index(entry)].queue
    assert queue[0] == 0
    assert 3 <= queue.max() <= entry.queue
    assert queue[-1] == np.sum(run.demand.due < 60.0) - np.sum(run.demand.entered < 60.0)


def test_a_page_holds_every_lane_of_generated_traffic(run, tmp_path):
    folder = save(run, tmp_path / "run")
    header = run_contents(folder).header
    rows = lane_flows(run)
    lanes = header["flows"]["lanes"]
    assert [(lane["side"], lane["lane"], lane["vehicles"]) for lane in lanes] == [
        (row.side, row.lane_id, row.vehicles) for row in rows
    ]
    n = len(header["flows"]["edges"]) - 1
    assert {len(lane[name]) for lane in lanes for name in ("flows", "speeds", "queues")} == {n}
    assert lanes[-1]["queues"] == [None] * n, "nobody waits before an exit"
    (folder / "demand.parquet").unlink()
    header = run_contents(folder).header
    assert "flows" not in header
    assert "No flows of generated traffic: demand.parquet is missing." in [one["text"] for one in header["missing"]]


def test_a_page_without_generated_traffic_has_no_flows(tmp_path):
    scenario = world(straight_road(200.0), problems=[problem(1, 20.0, goal=(150.0, 0.0), time_step=(0, 150))])
    assert "flows" not in run_contents(save(simulate(scenario, threads=1), tmp_path / "run")).header
