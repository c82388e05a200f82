"""The figure of messages: how old plans are, and how far messages get."""

import numpy as np
import pytest
from click.testing import CliRunner

from interdrive import save, simulate
from interdrive.cli import main
from interdrive.errors import InputError
from interdrive.plots import draw_messages
from interdrive.plots.messages import plan_ages, received_share


def drive(**v2x):
    settings = {f"v2x.{name}": value for name, value in v2x.items()}
    return simulate(
        "t_junction",
        settings={"v2x.penetration": 1.0, "record.messages": "links", "step.max_steps": 30, **settings},
        predictor="lane_following",
        threads=1,
    )


def test_a_plan_is_as_old_as_its_delay_and_older_where_the_next_one_was_lost():
    time, ages = plan_ages(drive(delay=0.2))
    assert ages.shape[1] == len(time)
    assert np.isnan(ages[:, time < 0.15]).all(), "nothing has arrived yet"
    known = ages[:, time > 0.25]
    np.testing.assert_allclose(known[np.isfinite(known)], 0.2)
    _, lossy = plan_ages(drive(delay=0.2, loss=0.5))
    assert np.nanmin(lossy) == pytest.approx(0.2)
    # The sum of 0.1 s times 0.5 to the power of 0, 1, 2, ... more.
    assert np.nanmean(lossy[:, 15:]) == pytest.approx(0.3, abs=0.03)


def test_the_share_of_messages_received_falls_with_the_distance_if_they_fade():
    _, flat = received_share(drive(loss=0.25))
    assert np.mean(flat) == pytest.approx(0.75, abs=0.05)
    run = drive(range=60.0, fading=True)
    distance, fading = received_share(run)
    assert distance[-1] < 60.0, "beyond the range nothing is known of losses"
    # Nakagami with m = 3: the probability that a gamma variable of that shape exceeds 3 (distance / range)².
    x = 3.0 * (np.asarray(distance) / 60.0) ** 2
    expected = np.exp(-x) * (1.0 + x + 0.5 * x**2)
    links = run.messages.distance[(run.messages.receiver_id >= 0) & (run.messages.distance <= 60.0)]
    number = np.histogram(links, np.append(distance - distance[0], distance[-1] + distance[0]))[0]
    assert (np.abs(fading - expected) <= 3.0 * np.sqrt(expected * (1.0 - expected) / number) + 0.05).all(), "3 sigma"
    assert fading[-1] < 0.7 < fading[0]


def test_the_command_draws_it_and_says_what_is_missing(tmp_path):
    folder = save(drive(loss=0.25), tmp_path / "run")
    figure = tmp_path / "messages.png"
    done = CliRunner().invoke(main, ["plot", str(folder), "--kind", "messages", "--out", str(figure)])
    assert done.exit_code == 0 and figure.stat().st_size > 10_000
    with pytest.raises(InputError, match="kept no links of messages"):
        draw_messages(simulate("t_junction", settings={"step.max_steps": 2}, threads=1))
