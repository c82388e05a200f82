"""Planners that break processes in known ways; the file is copied to where worker processes find it."""

import os
import signal
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from interdrive import Trajectory


def _stays(view) -> Trajectory:
    ego, n = view.ego, 21
    velocity = np.maximum(ego.velocity - 3.0 * view.dt * np.arange(n), 0.0)
    s = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * view.dt)])
    x, y = ego.x + s * np.cos(ego.orientation), ego.y + s * np.sin(ego.orientation)
    return Trajectory(x, y, np.full(n, ego.orientation), velocity)


class Brakes:
    """Comes to rest."""

    def plan(self, view, predictions):
        return _stays(view)


class Kills:
    """Takes its process with it."""

    def plan(self, view, predictions):
        os.kill(os.getpid(), signal.SIGKILL)


class KillsItsOwn(Kills):
    """Takes its process with it, which is not that of the run."""

    parallel = True


@dataclass
class KillsOnce:
    """Takes its process with it unless that has happened before.

    Attributes:
        flag: File that says so.
    """

    flag: str

    def plan(self, view, predictions):
        if not Path(self.flag).exists():
            Path(self.flag).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return _stays(view)


class Hangs:
    """Never answers."""

    def plan(self, view, predictions):
        while True:
            time.sleep(1.0)


class Grows:
    """Takes all the memory that it can get, up to 2 GiB."""

    def plan(self, view, predictions):
        self.hoard = []
        for _ in range(128):
            self.hoard.append(np.ones(2**21))
            time.sleep(0.02)
        return _stays(view)


class Slow:
    """Takes its time."""

    def plan(self, view, predictions):
        time.sleep(0.01)
        return _stays(view)


class ExplodingPlan:
    """Cannot be made."""

    def __init__(self):
        raise RuntimeError("no fuel")

    def plan(self, view, predictions):
        raise NotImplementedError


@dataclass
class Marks:
    """Leaves a file for every run that it begins, and waits as long as a file named `hold` lies beside the folder.

    Attributes:
        folder: Where.
    """

    folder: str
    begun: bool = field(default=False, init=False)

    def plan(self, view, predictions):
        if not self.begun:
            self.begun = True
            Path(self.folder, f"{os.getpid()}-{time.monotonic_ns()}").touch()
        while Path(self.folder).with_name("hold").exists():
            time.sleep(0.02)
        return _stays(view)


def begins_to_answer(connection):
    """Sends the length of a message and nothing of the message."""
    os.write(connection.fileno(), (100).to_bytes(4, "big"))
    time.sleep(600.0)
