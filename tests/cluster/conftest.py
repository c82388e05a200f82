"""A local Ray cluster of two nodes, started as Ray's documentation says: one head, one further node."""

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

RAY = Path(sys.executable).parent / "ray"


@dataclass
class Cluster:
    """Its address, and the process group of each node."""

    address: str
    head: subprocess.Popen
    node: subprocess.Popen

    def lose_node(self) -> None:
        """The second node is gone, as in a power failure."""
        end(self.node)

    def lose_head(self) -> None:
        """The node of this machine is gone, and what keeps the cluster together."""
        end(self.head)


def start(*arguments) -> subprocess.Popen:
    """A node as a session of its own, so that it can be ended with everything that it started."""
    environment = {**os.environ, "RAY_USAGE_STATS_ENABLED": "0", "RAY_worker_niceness": "0"}  # hurry as the test does
    return subprocess.Popen(
        [RAY, "start", "--num-cpus=1", "--object-store-memory=100000000", "--block", *arguments],
        start_new_session=True,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def end(process: subprocess.Popen) -> None:
    """Ends a node at once, as a power failure would."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def seen(address: str) -> tuple[int, str]:
    """How many nodes there are, and the address of the one that a program on this machine connects through."""
    script = (
        f"import ray; ray.init(address='{address}', logging_level='ERROR', log_to_driver=False); "
        "mine = ray.get_runtime_context().get_node_id(); nodes = [node for node in ray.nodes() if node['Alive']]; "
        "print(len(nodes), *(node['NodeManagerAddress'] for node in nodes if node['NodeID'] == mine))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=90)
    count, _, through = done.stdout.strip().partition(" ")
    return int(count or 0), through


def written_by_nodes(folder: Path) -> list[Path]:
    """Files that name the node through which programs on this machine connect: whichever was the last one to start.

    Those of sessions, not of the link to the latest: each node that starts takes the link away for a moment.
    """
    found = folder.glob("session_*/node_ip_address.json")
    return [path for path in found if not path.parent.is_symlink()]


@contextlib.contextmanager
def started():
    """Two nodes with one CPU each, the second one as if it were on another machine.

    A client connects through the node on its machine, and is lost with it. Nodes on one machine are told apart
    by their addresses; which of them is the machine's stands in a file that the last one to start has written.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address, folder = f"127.0.0.1:{port}", tempfile.mkdtemp(prefix="ray")  # short: sockets lie in it
    head = start("--head", "--node-ip-address=127.0.0.1", f"--port={port}", "--include-dashboard=false",
                 f"--temp-dir={folder}")  # fmt: skip
    node = None
    try:
        until = time.monotonic() + 120
        while (now := seen(address))[0] < 1:
            assert time.monotonic() < until, "the head did not start"
        here = now[1]
        node = start(f"--address={address}", "--node-ip-address=127.0.0.2")
        while not any("127.0.0.2" in path.read_text() for path in written_by_nodes(Path(folder))):
            assert time.monotonic() < until, "the second node did not start"
            time.sleep(0.05)
        for path in written_by_nodes(Path(folder)):
            path.write_text(json.dumps({"node_ip_address": here}))
        while (now := seen(address)) != (2, here):
            assert time.monotonic() < until, ("the second node did not start", now)
        yield Cluster(address, head, node)
    finally:
        for process in (node, head):
            if process is not None:
                end(process)
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="module")
def cluster():
    """One that lasts; tests that use it come last, since it is found by others."""
    with started() as found:
        yield found


@pytest.fixture
def mortal_cluster():
    """One whose nodes may be lost."""
    with started() as found:
        yield found
