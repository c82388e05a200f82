"""How far a drive came, and when the drivers of the panel came as far."""

import math
from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive import _core
from interdrive.scoring.drive_facts import drives_of
from interdrive.testing import problem, straight_road, world


def driven(velocity: float, goal: float):
    """Of one agent that drives 10 m/s along an empty road to a goal area of 10 m."""
    scenario = world(
        straight_road(300.0), problems=[problem(100, 10.0, 0.0, velocity, 0.0, goal=(goal, 0.0), time_step=(0, 200))]
    )
    run = idr.simulate(scenario, planner="lawful", threads=1)
    return drives_of(run, [100])[100]


def test_a_drive_that_arrived_goes_on_in_free_flow_for_those_who_come_further():
    drive = driven(10.0, 100.0)
    assert drive.arrived
    end, speed = drive.time[-1], drive.velocity[-1]
    assert drive.time_to(drive.distance) <= end
    beyond = drive.time_to(drive.distance + 6.5) - end
    assert 0.2 < beyond < 6.0 / speed + 0.05, "s for 6 m at its speed, or faster"
    stopped = replace(drive, arrived=False)
    assert math.isinf(stopped.time_to(drive.distance + 6.5))


def test_a_way_that_leads_by_its_start_again_begins_at_the_first_time():
    angle = np.linspace(0.0, 2.4 * np.pi, 400)
    radius = 50.0 - 0.4 * angle / (2.0 * np.pi)  # the second time 0.4 m further inside
    path = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    turned = np.linspace(0.2, 2.3 * np.pi, 300)
    s, _ = _core.follow_path(path, 49.6 * np.cos(turned), 49.6 * np.sin(turned))
    assert s[0] == pytest.approx(10.0, abs=0.2), "m, not one turn later"
    assert np.all(np.diff(s) > 0.0)
    assert s[-1] == pytest.approx(49.8 * 2.3 * np.pi, abs=2.0)
