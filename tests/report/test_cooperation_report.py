"""What the page of a run says about V2X."""

from types import SimpleNamespace

import numpy as np
import pytest
from meetings import four_arms

from interdrive import load, save, simulate
from interdrive.report.contents import run_contents
from interdrive.report.cooperation import links
from interdrive.run import SERVICES, Messages

MCM = SERVICES.index("mcm")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    settings = {"v2x.penetration": 1.0, "v2x.negotiate": True, "rules.precedence": False}
    settings |= {"record.messages": "links", "step.max_steps": 200}
    run = simulate(four_arms(), planner="rollout", predictor="lane_following", settings=settings, threads=1)
    return save(run, tmp_path_factory.mktemp("v2x") / "run")


def told(rows, n_steps=7):
    """Messages to 1, 2 and 3, whose rows are 0, 1 and 2, from (sent, sender, receiver, arrived, service)."""
    sent, sender, receiver, arrived, service = (np.array(column) for column in zip(*rows, strict=True))
    zero = np.zeros(len(rows), dtype=np.int64)
    messages = Messages(sent, sender, service, zero, zero, zero, zero, zero, receiver, arrived, zero.astype(float))
    states = SimpleNamespace(first_time_step=10, n_steps=n_steps, participant_id=np.array([1, 2, 3]))
    return messages, SimpleNamespace(states=states, scenario=SimpleNamespace(dt=0.1))


def test_a_link_has_the_age_of_the_newest_plan_until_it_is_forgotten():
    messages, run = told(
        [
            (10, 2, 1, 11, MCM),
            (11, 2, 1, -1, MCM),  # lost
            (12, 2, 1, 14, MCM),  # late
            (13, 2, -1, -1, MCM),  # the row of a message without an agent in range
            (12, 3, 1, 13, 0),  # a state, no plan
            (10, 1, 2, -1, MCM),  # lost, and no other one
        ]
    )
    rows, age, lost = links(messages, run, age_max=0.35)
    assert rows.tolist() == [[0, 1], [1, 0]]
    # At 11 it is one step old, at 13 three, at 14 a plan of step 12 arrives.
    assert age.tolist() == [[0, 1, 2, 3, 2, 3, 0], [0, 0, 0, 0, 0, 0, 0]]
    assert lost.astype(int).tolist() == [[0, 0, 1, 0, 0, 0, 0], [0, 1, 1, 1, 1, 1, 1]]


def test_the_page_has_links_bars_and_events_of_agreements(folder):
    header = run_contents(folder).header
    agreements = load(folder).agreements
    assert header["arrays"]["link_rows"]["shape"] == [12, 2]
    assert header["arrays"]["bar_rows"]["shape"] == [len(agreements.holding_id), 2]
    holds = [event["text"] for event in header["events"] if event["kind"] == "hold"]
    seconds = 0.1 * (agreements.last_time_step[0] - agreements.first_time_step[0] + 1)
    assert holds[0] == f"2 holds for 1 ({seconds:.1f} s)"
    assert len(holds) == len(agreements.holding_id)


def test_the_page_says_what_to_record_if_messages_are_missing(tmp_path):
    settings = {"v2x.penetration": 1.0, "step.max_steps": 3}
    run = simulate(four_arms(), planner="rollout", predictor="lane_following", settings=settings, threads=1)
    header = run_contents(save(run, tmp_path / "run")).header
    assert "link_rows" not in header["arrays"]
    assert any(m["what"] == "links" and "record.messages=links" in m["text"] for m in header["missing"])
