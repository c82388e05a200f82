"""What Ray gives up is handed to it again, and a lost cluster is an error; Ray itself is invented here.

tests/cluster has the real one.
"""

import os
import types

import pytest

from interdrive import InputError, InterdriveError
from interdrive.batches import ray as cluster
from interdrive.batches import ray_driver
from interdrive.batches.pool import Task
from interdrive.batches.ray import Cluster
from interdrive.batches.ray_driver import Driver, NodeError

pytestmark = pytest.mark.long


class RayError(Exception):
    """Ray gave a task up."""


class RayTaskError(RayError):
    """What was called has raised."""

    def __init__(self, cause):
        super().__init__(f"ray::_in_process() (pid=1, ip=10.0.0.7)\n{cause}")
        self.cause = cause


class LocalRayletDiedError(RayError):
    """The node through which the batch is connected is lost."""


class OutOfMemoryError(RayError):
    """A node had no memory left."""


class InventedRay:
    """Does tasks at once; those in `losses` are given up so often, with what `failure` makes."""

    exceptions = types.SimpleNamespace(
        RayError=RayError,
        RayTaskError=RayTaskError,
        LocalRayletDiedError=LocalRayletDiedError,
        OutOfMemoryError=OutOfMemoryError,
    )

    def __init__(self, losses, failure=lambda: RayError("its node is gone\nand more")):
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
            raise self.failure()
        return payload.upper(), "", "", 1


def ends(ray, monkeypatch, payloads="abc"):
    monkeypatch.setattr(ray_driver, "_PAUSE", 0.01)
    waiting = list(enumerate(payloads))
    found = Driver(ray, 2, (1.0, 1.0)).run(len, lambda: waiting.pop(0) if waiting else None)
    return {payloads[number]: tuple(how) for number, *how in found}


def test_a_task_that_ray_gives_up_is_handed_over_again(monkeypatch):
    ray = InventedRay({"b": 3})
    assert ends(ray, monkeypatch) == {name: (name.upper(), "", "", 1) for name in "abc"}
    assert sorted(ray.given) == ["a", "b", "b", "b", "b", "c"]


def test_a_task_that_ray_gives_up_for_good_is_a_row(monkeypatch):
    ray = InventedRay({"b": 99})
    found = ends(ray, monkeypatch)
    assert found["b"] == (None, "crashed", "Ray gave it up: its node is gone", 6)
    assert ray.given.count("b") == 6
    assert found["a"][0] == "A"
    assert found["c"][0] == "C"


def test_a_task_that_is_too_large_for_its_node_is_a_row_at_once(monkeypatch):
    ray = InventedRay({"b": 99}, lambda: OutOfMemoryError("Task was killed.\nand more"))
    assert ends(ray, monkeypatch)["b"] == (
        None,
        "memory",
        "Ray ended it, its node ran out of memory: Task was killed",
        2,
    )
    assert ray.given.count("b") == 1


@pytest.mark.parametrize("payloads", ["b", "ab"])
def test_a_node_that_cannot_do_runs_ends_the_batch(monkeypatch, payloads):
    ray = InventedRay({"b": 99}, lambda: RayTaskError(ImportError("No module named 'interdrive'\nand more")))
    with pytest.raises(InterdriveError, match=r"^node 10.0.0.7 cannot do runs: No module named 'interdrive' \(nodes "):
        ends(ray, monkeypatch, payloads)
    assert ray.given.count("b") == 1


def test_a_node_on_which_no_process_starts_is_not_the_end_while_others_do(monkeypatch):
    ray = InventedRay({"b": 5}, lambda: RayTaskError(NodeError("it was not ready")))
    assert ends(ray, monkeypatch)["b"] == ("B", "", "", 1)
    ray = InventedRay({"b": 6}, lambda: RayTaskError(NodeError("it was not ready")))
    with pytest.raises(InterdriveError, match=r"^node 10.0.0.7 cannot do runs: it was not ready "):
        ends(ray, monkeypatch)


def test_the_node_of_this_machine_that_is_lost_ends_the_batch(monkeypatch):
    with pytest.raises(InterdriveError, match=r"^the node on this machine is lost$"):
        ends(InventedRay({"b": 1}, LocalRayletDiedError), monkeypatch)


def does_two_and_is_ended(connection, words, *_):
    """As Ray ends a process: at once, with a word of its own."""
    connection.send(("begun", None))
    connection.send(("connected", None))
    connection.recv()
    for _ in range(2):
        connection.send(("take", None))
        number, payload = connection.recv()
        connection.send(("end", (number, payload.upper(), "", "", 1)))
    words.write_text("[2026-01-01 00:00:00,000 E 1 2] gcs_rpc_client.h:196: No answer within 60 seconds. And more.\n")
    os._exit(1)


def meets_an_unknown_error(connection, words, *_):
    """The real process, with a Ray that knows nothing."""
    ray_driver._connected = lambda _: types.SimpleNamespace()
    ray_driver.drive(connection, words, "nowhere:1", None, (1.0, 1.0))


def is_ended_before_it_is_connected(connection, words, *_):
    """As Ray ends a process whose cluster does not answer."""
    connection.send(("begun", None))
    words.write_text("It is \x1b[36mno cluster\x1b[39m. Perhaps.\n")
    os._exit(1)


def finds_no_cluster(connection, *_):
    """Says so."""
    connection.send(("begun", None))
    connection.send(("error", InputError("ray nowhere: no cluster answers there")))


def does_not_begin(*_):
    """As in a script that starts a batch without a guard."""
    raise SystemExit(1)


@pytest.fixture
def driven(monkeypatch):
    """Makes a cluster whose process is another one."""
    monkeypatch.setattr(cluster.importlib.util, "find_spec", lambda _: True)

    def cluster_of(process):
        monkeypatch.setattr(cluster, "drive", process)
        return Cluster("nowhere:1", None)

    return cluster_of


def test_a_cluster_that_is_lost_is_one_line_in_rays_words(driven):
    backend = driven(does_two_and_is_ended)
    tasks, found = [Task(payload) for payload in "abc"], []
    with pytest.raises(InterdriveError) as error:
        for end in backend.run(len, lambda _: tasks.pop(0)):
            found.append(end.value)
    backend.close()
    assert found == ["A", "B"]
    assert str(error.value) == (
        "ray nowhere:1: the cluster, or its node on this machine, is lost (No answer within 60 seconds); "
        "finished runs are kept, repeat the command to do the missing ones"
    )


def test_an_unknown_error_is_named(driven):
    backend = driven(meets_an_unknown_error)
    with pytest.raises(
        InterdriveError, match=r"^ray nowhere:1: AttributeError: .* has no attribute 'remote'; finished runs"
    ):
        list(backend.run(len, lambda _: Task("a")))
    backend.close()


def test_a_process_that_does_not_get_as_far_as_that_is_one_line(driven):
    with pytest.raises(InputError, match=r"^ray nowhere:1: no cluster answers there \(It is no cluster\); start one"):
        driven(is_ended_before_it_is_connected)
    with pytest.raises(InputError, match=r"^ray nowhere: no cluster answers there$"):
        driven(finds_no_cluster)
    with pytest.raises(InterdriveError, match=r"ended at once \(exit code 1\); does the script guard its calls"):
        driven(does_not_begin)
