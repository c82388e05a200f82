"""What Ray gives up is handed to it again; Ray itself is invented here (tests/cluster has the real one)."""

import types

import pytest

from interdrive.batches import cluster
from interdrive.batches.cluster import Cluster
from interdrive.batches.pool import Task


class RayError(Exception):
    """Ray gave a task up."""


class RayTaskError(RayError):
    """What was called has raised."""


class InventedRay:
    """Does tasks at once; those in `losses` are given up so often, which `failure` says why."""

    exceptions = types.SimpleNamespace(RayError=RayError, RayTaskError=RayTaskError)

    def __init__(self, losses, failure=RayError):
        self.losses, self.failure, self.given = dict(losses), failure, []

    def remote(self, **_):
        return lambda _function: types.SimpleNamespace(remote=self.hand_over)

    def hand_over(self, _function, payload, *_):
        self.given.append(payload)
        return (payload, len(self.given))

    def wait(self, references, **_):
        return references[:1], references[1:]

    def get(self, reference):
        payload = reference[0]
        if self.losses.get(payload, 0):
            self.losses[payload] -= 1
            raise self.failure("its node is gone\nand more")
        return payload.upper(), "", "", 1


def ends(ray, monkeypatch, payloads="abc"):
    monkeypatch.setattr(cluster, "_PAUSE", 0.01)
    backend = Cluster.__new__(Cluster)
    backend._ray, backend._workers, backend._limits = ray, 2, (1.0, 1.0)
    backend._waiting, backend._is_ours = {}, False
    waiting = [Task(payload) for payload in payloads]
    found = list(backend.run(len, lambda _: waiting.pop(0) if waiting else None))
    return {end.task.payload: (end.value, end.lost, end.why, end.attempts) for end in found}


def test_a_task_that_ray_gives_up_is_handed_over_again(monkeypatch):
    ray = InventedRay({"b": 3})
    found = ends(ray, monkeypatch)
    assert found == {name: (name.upper(), "", "", 1) for name in "abc"}
    assert sorted(ray.given) == ["a", "b", "b", "b", "b", "c"]


def test_a_task_that_ray_gives_up_for_good_is_a_row(monkeypatch):
    ray = InventedRay({"b": 99})
    found = ends(ray, monkeypatch)
    assert found["b"] == (None, "crashed", "Ray gave it up: its node is gone", 6)
    assert ray.given.count("b") == 6
    assert found["a"][0] == "A"
    assert found["c"][0] == "C"


@pytest.mark.parametrize("payloads", ["b", "ab"])
def test_what_raised_is_not_done_again(monkeypatch, payloads):
    ray = InventedRay({"b": 99}, RayTaskError)
    assert ends(ray, monkeypatch, payloads)["b"][1:] == ("crashed", "Ray gave it up: its node is gone", 1)
