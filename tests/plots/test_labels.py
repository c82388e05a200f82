"""Ids in pictures can be read: they do not cover each other, even where many agents meet."""

import numpy as np
import pytest

import interdrive as idr
from interdrive.plots import draw_run, draw_scene


@pytest.fixture(scope="module")
def run():
    return idr.simulate("t_junction", agents="all", predictor="constant_velocity")


def covered(figure, texts):
    """Pairs of texts whose boxes share more than a tenth of the smaller one."""
    figure.canvas.draw()
    found = [text for text in figure.axes[0].texts if text.get_text() in texts]
    boxes = [text.get_window_extent() for text in found]
    pairs = []
    for i, first in enumerate(boxes):
        for j in range(i):
            shared = np.minimum(first.max, boxes[j].max) - np.maximum(first.min, boxes[j].min)
            if (shared > 0).all() and shared.prod() > 0.1 * min(np.prod(first.size), np.prod(boxes[j].size)):
                pairs.append((found[i].get_text(), found[j].get_text()))
    return len(found), pairs


@pytest.mark.parametrize("seconds", [0.0, 4.0, 5.0])
@pytest.mark.parametrize("columns", [1, 2])
def test_the_ids_of_eight_agents_that_meet_at_a_junction_do_not_cover_each_other(run, seconds, columns):
    figure = draw_scene(run, None, seconds, columns=columns)
    assert covered(figure, {str(agent.id) for agent in run.agents}) == (8, [])


def test_the_ids_of_a_still_do_not_cover_each_other(run):
    n, pairs = covered(draw_run(run), {str(agent.id) for agent in run.agents})
    assert n >= 8 and pairs == [], "an agent that has ended elsewhere has a second one"
