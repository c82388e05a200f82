"""Who wants to enter when, by the seed alone."""

import numpy as np
import pytest

from interdrive import InputError, TrafficSettings
from interdrive.traffic import due_times
from interdrive.traffic.arrivals import vehicles
from interdrive.traffic.draws import normal, uniform
from interdrive.traffic.filling import equilibrium_speed


def test_an_hour_at_600_has_600_vehicles_with_shifted_exponential_headways():
    settings = TrafficSettings(rate=600.0, duration=3600.0)
    for lane in (1, 77, 50195):
        due = due_times(settings, 3, lane, 600.0)
        headways = np.diff(due, prepend=0.0)
        assert 525 <= len(due) <= 675
        assert headways.min() >= 1.5
        assert headways.mean() == pytest.approx(6.0, abs=0.6)
        # Half of an exponential part lies below ln 2 of its mean.
        assert np.mean(headways - 1.5 < 4.5 * np.log(2.0)) == pytest.approx(0.5, abs=0.07)


def test_demand_depends_on_seed_and_lane_alone():
    settings = TrafficSettings(rate=900.0, duration=600.0)
    first = due_times(settings, 1, 5, 900.0)
    assert np.array_equal(first, due_times(settings, 1, 5, 900.0))
    assert not np.array_equal(first[:50], due_times(settings, 2, 5, 900.0)[:50])
    assert not np.array_equal(first[:50], due_times(settings, 1, 6, 900.0)[:50])
    few, many = vehicles(settings, 1, 5, np.arange(10)), vehicles(settings, 1, 5, np.arange(300))
    assert few.kinds == many.kinds[:10]
    assert few.drivers == many.drivers[:10]


def test_a_profile_changes_the_rate_from_a_time_on():
    settings = TrafficSettings(rate=600.0, duration=3000.0, profile=("1000:2", "2000:0"))
    due = due_times(settings, 1, 1, 600.0)
    counts = [int(((due >= begin) & (due < begin + 1000.0)).sum()) for begin in (0.0, 1000.0, 2000.0)]
    assert counts[0] == pytest.approx(167, abs=35)
    assert counts[1] == pytest.approx(333, abs=50)
    assert counts[2] <= 1


def test_kinds_sizes_and_drivers_are_as_the_settings_say():
    settings = TrafficSettings(rate=1.0, planner="idm:3+rollout:1")
    found = vehicles(settings, 4, 9, np.arange(4000))
    shares = [found.kinds.count(kind) / 4000 for kind in ("car", "truck", "motorcycle")]
    assert shares == pytest.approx([0.88, 0.1, 0.02], abs=0.02)
    cars = np.array([kind == "car" for kind in found.kinds])
    assert found.length[cars].mean() == pytest.approx(4.6, abs=0.02)
    assert found.length[cars].min() >= 4.0 - 1e-9
    assert found.length[cars].max() <= 5.2 + 1e-9
    assert np.mean([driver.planner == 0 for driver in found.drivers]) == pytest.approx(0.75, abs=0.03)
    gaps = np.array([driver.time_gap for driver in found.drivers])
    assert gaps.min() >= 0.8
    assert gaps.mean() == pytest.approx(1.2, abs=0.02)


def test_draws_are_uniform_and_normal():
    values = uniform(7, 0, -3, np.arange(20000))
    assert values.min() >= 0.0
    assert values.max() < 1.0
    assert np.histogram(values, bins=10)[0] == pytest.approx([2000] * 10, abs=200)
    z = normal(7, 1, 3, np.arange(20000))
    assert abs(z.mean()) < 0.02
    # A standard normal number that is cut at 2 has this standard deviation.
    assert z.std() == pytest.approx(0.954, abs=0.01)
    assert uniform(0, 0, 1, 5)[0] == uniform(0, 0, 1, np.array([4, 5]))[1]


@pytest.mark.parametrize("speed", [5.0, 20.0, 30.0])
def test_the_equilibrium_speed_is_that_of_the_model(speed):
    gap = (2.0 + 1.2 * speed) / np.sqrt(1.0 - (speed / 35.0) ** 4)
    assert equilibrium_speed(gap, 35.0, 1.2) == pytest.approx(speed, abs=1e-6)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"rate": 2400.0}, "rate: the rate must be at least 0 and below 2400 vehicles per hour"),
        ({"rate": 1300.0, "profile": ("10:2",)}, "not 1300 times 2 (traffic.profile)"),
        ({"rates": ("12=5",)}, "rates: write LANELET:RATE, not '12=5'"),
        ({"rates": ("12:5", "12:6")}, "rates: a number is there twice"),
        ({"density": -1.0}, "density: must be at least 0"),
        ({"mix": (0.0, 0.0, 0.0)}, "mix: must be shares"),
        ({"planner": "idm:-1"}, "planner: write a planner, or shares such as"),
    ],
)
def test_impossible_settings_are_named(values, text):
    with pytest.raises(InputError) as refused:
        settings = TrafficSettings(**values)
        assert settings.planners
    assert text in str(refused.value)
