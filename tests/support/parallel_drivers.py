"""Planners that may run in processes of their own: importable from there."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import time

import numpy as np
from drivers import Straight

from interdrive import Trajectory


class Remembering(Straight):
    """Brakes a little more at every plan, so its answers depend on what it remembers, and on what it sees."""

    parallel = True

    def __init__(self):
        self.plans = 0

    def plan(self, view, predictions):
        self.plans += 1
        ego, time_ahead = view.ego, np.arange(31) * view.dt
        near = float(np.sum(view.valid[:, -1])) + float(np.sum(predictions.probability))
        braking = min(0.01 * self.plans * near, ego.velocity / (2 * time_ahead[-1]))
        velocity = ego.velocity - braking * time_ahead
        travelled = ego.velocity * time_ahead - 0.5 * braking * time_ahead**2
        x = ego.x + travelled * np.cos(ego.orientation)
        y = ego.y + travelled * np.sin(ego.orientation)
        return Trajectory(x, y, np.full_like(x, ego.orientation), velocity)


class Alone(Remembering):
    """The same in the process of the run."""

    parallel = False


class Elsewhere(Straight):
    """Fails unless it runs in another process than the one named in the environment."""

    parallel = True

    def plan(self, view, predictions):
        if os.getpid() == int(os.environ["INTERDRIVE_TEST_PID"]):
            raise RuntimeError("same process")
        return super().plan(view, predictions)


class Telling(Straight):
    """Tells at time step 5 which turns it sees."""

    parallel = True

    def plan(self, view, predictions):
        if view.time_step == 5:
            raise ValueError(f"turns {view.turn.tolist()}")
        return super().plan(view, predictions)


class TellingHere(Telling):
    """The same in the process of the run."""

    parallel = False


class Raising(Straight):
    parallel = True

    def plan(self, view, predictions):
        if view.time_step == 3:
            raise ValueError("no idea")
        return super().plan(view, predictions)


class Dying(Straight):
    parallel = True

    def plan(self, view, predictions):
        if view.time_step == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().plan(view, predictions)


class Leaving(Straight):
    parallel = True

    def plan(self, view, predictions):
        if view.time_step == 3:
            os._exit(7)
        return super().plan(view, predictions)


class Sleeping(Straight):
    """Reacts to signals."""

    def plan(self, view, predictions):
        if view.time_step == 3:
            with contextlib.suppress(Exception):
                time.sleep(60)
        return super().plan(view, predictions)


class Stuck(Straight):
    """Hangs in foreign code with signals blocked, so nothing in its process can stop it."""

    parallel = True

    def plan(self, view, predictions):
        if view.time_step == 3:
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
            ctypes.CDLL(None).sleep(60)
        return super().plan(view, predictions)


class MuteError(Exception):
    def __str__(self):
        raise RuntimeError("no comment")


class Own(BaseException):
    pass


class Unprintable(Straight):
    parallel = True

    def plan(self, view, predictions):
        raise MuteError


class EndingItself(Straight):
    parallel = True

    def plan(self, view, predictions):
        raise Own


class Interrupting(Straight):
    parallel = True

    def plan(self, view, predictions):
        raise KeyboardInterrupt
