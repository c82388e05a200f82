"""Terms of the score: tables computed by hand (docs/reference/scoring.md)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from interdrive.errors import InputError
from interdrive.scoring import ComfortBounds, ScoringSettings
from interdrive.scoring.score_1 import weighted
from interdrive.scoring.smoothing import smoothed
from interdrive.scoring.terms import Motion, comfort_term, direction_term, progress_term, speed_term, ttc_term

DT = 0.1
WEIGHTS = {"progress": 5.0, "ttc": 5.0, "speed": 4.0, "comfort": 2.0}


def motion(acceleration, *, velocity=10.0, orientation=None):
    n = len(acceleration)
    heading = np.zeros(n) if orientation is None else orientation
    speed = np.full(n, velocity)
    return Motion(
        np.arange(1, n + 1), np.arange(n) * 1.0, np.zeros(n), heading, speed, acceleration, np.full(n, np.nan)
    )


def test_a_ramp_of_1_5_m_s2_in_a_second_has_a_filtered_jerk_of_1_285714():
    ramp = 1.5 * np.clip(np.arange(-15, 16) / 10 + 0.5, 0.0, 1.0)
    assert smoothed(ramp, 15, DT, 1).max() == pytest.approx(1.285714, abs=1e-6)
    assert np.diff(ramp).max() / DT == pytest.approx(1.5)
    assert comfort_term(motion(ramp), DT, ComfortBounds(longitudinal_jerk=1.29, jerk=1.29)).value == 1.0
    found = comfort_term(motion(ramp), DT, ComfortBounds(longitudinal_jerk=1.28))
    assert (found.value, found.words) == (0.0, "longitudinal jerk 1.29 m/s³ at 1.6 s (1.28 allowed)")


def test_a_parabola_passes_the_filter_unchanged_at_its_ends_too():
    t = np.arange(20) * DT
    for window in (7, 15, 99):
        assert smoothed(3.0 * t**2 - t, window, DT) == pytest.approx(3.0 * t**2 - t, abs=1e-12)
        assert smoothed(3.0 * t**2 - t, window, DT, 1) == pytest.approx(6.0 * t - 1.0, abs=1e-10)
        assert smoothed(3.0 * t**2 - t, window, DT, 2) == pytest.approx(np.full(20, 6.0), abs=1e-8)


def test_comfort_is_told_by_the_bound_that_is_exceeded_most():
    """It speeds up with 2.5 m/s² of 2.4, and turns with 6 m/s² of 4.89."""
    drive = motion(np.full(40, 2.5), velocity=10.0, orientation=0.06 * np.arange(40))
    assert comfort_term(drive, DT, ComfortBounds()).words.startswith("lateral acceleration 6.00 m/s² at ")


def test_comfort_needs_three_states():
    assert math.isnan(comfort_term(motion(np.zeros(2)), DT, ComfortBounds()).value)
    assert comfort_term(motion(np.zeros(3)), DT, ComfortBounds()).value == 1.0


@pytest.mark.parametrize(("velocity", "acceleration"), [(5.0, 3.5), (-5.0, -3.5)])
def test_speeding_up_and_braking_have_bounds_of_their_own_in_both_directions(velocity, acceleration):
    faster = comfort_term(motion(np.full(20, acceleration), velocity=velocity), DT, ComfortBounds())
    assert faster.words.startswith("acceleration 3.50 m/s²")
    assert comfort_term(motion(np.full(20, -acceleration), velocity=velocity), DT, ComfortBounds()).value == 1.0
    harder = comfort_term(motion(np.full(20, -1.2 * acceleration), velocity=velocity), DT, ComfortBounds())
    assert harder.words.startswith("deceleration 4.20 m/s²")


def test_turning_is_judged_by_heading_across_its_wrap():
    turning = np.pi - 0.5 + 0.09 * np.arange(12)
    wrapped = np.arctan2(np.sin(turning), np.cos(turning))
    assert comfort_term(motion(np.zeros(12), velocity=1.0, orientation=wrapped), DT, ComfortBounds()).value == 1.0
    fast = comfort_term(motion(np.zeros(12), velocity=10.0, orientation=wrapped), DT, ComfortBounds())
    assert fast.words.startswith("lateral acceleration 9.00 m/s²")


def test_two_metres_per_second_too_fast_in_3_of_10_seconds_leave_0_730942():
    velocity = np.where(np.arange(100) < 30, 12.0, 10.0)
    found = speed_term(velocity, np.full(100, 10.0), DT, 2.23)
    assert found.value == pytest.approx(0.730942, abs=1e-6)
    assert found.words == "up to 2.0 m/s too fast, 3.0 s in all"
    unlimited = np.where(np.arange(100) < 50, np.inf, np.nan)
    assert math.isnan(speed_term(velocity, unlimited, DT, 2.23).value)
    # Only the time with a limit counts.
    half = np.where(np.arange(100) < 50, 10.0, np.inf)
    assert speed_term(velocity, half, DT, 2.23).value == pytest.approx(1.0 - 6.0 / (2.23 * 5.0))


@pytest.mark.parametrize(
    ("driven", "expected", "value"),
    [(80.0, 100.0, 0.8), (0.0, 0.0, 1.0), (1.0, 1.9, 1.0), (120.0, 100.0, 1.0), (-1.9, 8.0, 0.25), (-2.1, 8.0, 0.0)],
)
def test_progress_is_a_share_of_what_was_expected_and_2_metres_are_none(driven, expected, value):
    assert progress_term(driven, expected, "the recording").value == pytest.approx(value)


def test_metres_against_the_lane_within_a_second_make_the_direction():
    for n, value in ((1, 1.0), (2, 0.5), (5, 0.5), (6, 0.0), (12, 0.0)):
        off = np.where(np.arange(20) < n, 3.0, 0.0)
        assert direction_term(motion(np.zeros(20)), off, DT).value == value, n
    off_road = np.full(20, np.nan)
    assert direction_term(motion(np.zeros(20)), off_road, DT).value == 1.0


def test_the_time_to_contact_has_to_stay_above_0_95_seconds():
    steps, partner = np.arange(1, 4), np.array([-1, 7, 7])
    assert ttc_term(np.array([np.inf, 1.005, 0.96]), partner, steps, DT, 0.95).value == 1.0
    found = ttc_term(np.array([np.inf, 1.005, 0.905]), partner, steps, DT, 0.95)
    assert (found.value, found.words) == (0.0, "0.91 s to a contact with 7 at 0.3 s")


def test_scores_are_factors_times_the_weighted_mean_of_what_can_be_told():
    terms = {"progress": 0.8, "ttc": 1.0, "speed": 0.730942, "comfort": 0.0}
    assert weighted({}, terms, WEIGHTS) == pytest.approx(0.745235, abs=1e-6)
    assert weighted({}, terms | {"speed": math.nan}, WEIGHTS) == pytest.approx(0.75)
    assert weighted({"direction": 0.5}, terms, WEIGHTS) == pytest.approx(0.372618, abs=1e-6)
    assert weighted({}, terms | {"comfort": 1.0}, WEIGHTS) == pytest.approx(0.870235, abs=1e-6)
    assert weighted({"fault": 0.0}, dict.fromkeys(terms, math.nan), WEIGHTS) == 0.0


@pytest.mark.parametrize("change", [{"overspeed": 0.0}, {"ttc_bound": 3.0}, {"progress_min": math.nan}])
def test_impossible_settings_are_refused_by_name(change):
    with pytest.raises(InputError, match=next(iter(change))):
        ScoringSettings(**change)
