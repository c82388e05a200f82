"""A local Ray cluster of two nodes, started as Ray's documentation says: one head, one further node."""

import contextlib
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


def start(*arguments) -> subprocess.Popen:
    """A node as a session of its own, so that it can be ended with everything that it started."""
    environment = {**os.environ, "RAY_USAGE_STATS_ENABLED": "0"}
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


def nodes_alive(address: str) -> int:
    script = (
        f"import ray; ray.init(address='{address}', logging_level='ERROR', log_to_driver=False); "
        "print(sum(node['Alive'] for node in ray.nodes()))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=60)
    return int(done.stdout.strip() or 0)


@pytest.fixture
def cluster():
    """Two nodes with one CPU each."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address, folder = f"127.0.0.1:{port}", tempfile.mkdtemp(prefix="ray")  # short: sockets lie in it
    head = start("--head", "--node-ip-address=127.0.0.1", f"--port={port}", "--include-dashboard=false",
                 f"--temp-dir={folder}")  # fmt: skip
    node = None
    try:
        until = time.monotonic() + 90
        while nodes_alive(address) < 1:
            assert time.monotonic() < until, "the head did not start"
        node = start(f"--address={address}", "--node-ip-address=127.0.0.1")
        while nodes_alive(address) < 2:
            assert time.monotonic() < until, "the second node did not start"
        yield Cluster(address, head, node)
    finally:
        for process in (node, head):
            if process is not None:
                end(process)
        shutil.rmtree(folder, ignore_errors=True)
