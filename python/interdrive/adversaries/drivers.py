"""Drivers that a score must not reward: crude ones, and honest ones with a single vice.

Most are `lawful`, written in Python, with one change; what they lose is due to that change.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from interdrive.native_settings import Idm, Lawful, Rollout, RulesSettings
from interdrive.planners import Trajectory

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive import _core
    from interdrive.array_types import Floats
    from interdrive.planners import Planner

#: Points of a plan; an offset from the path is given up over this time [s], or this distance if that is longer [m].
_POINTS, _FADING_TIME, _FADING = 31, 2.5, 12.0
#: How far ahead a driver looks, and largest offset of a vehicle in its lane [m].
_AHEAD, _LANE = 80.0, 2.0
#: Lateral acceleration in curves, braking before limits, and hardest braking [m/s²].
_ACROSS, _BRAKING, _HARDEST = 4.0, 3.0, 8.0
#: Its front stops this far before a line [m].
_BEFORE_LINE = 0.5
#: Yaw rate with which the road is left [rad/s].
_TURNING = 0.15
#: A speed where none is stated [m/s].
_UNSTATED = 30.0


class Driver:
    """Follows its reference path as `lawful` does."""

    obeys_rules: ClassVar[bool] = True
    speed_factor: ClassVar[float] = 1.0
    time_gap: ClassVar[float] = 1.0
    minimum_gap: ClassVar[float] = 2.0
    acceleration: ClassVar[float] = 1.5
    deceleration: ClassVar[float] = 2.0
    offset: ClassVar[float] = 0.0

    def plan(self, view: _core.View, predictions: _core.Predictions) -> Trajectory:
        """Follows the reference path with the acceleration of `rate`."""
        return along(view, max(self.rate(view), -_HARDEST), self.offset)

    def rate(self, view: _core.View) -> float:
        """Acceleration [m/s²]."""
        found = self.car_following(view.ego.velocity, self.speed_factor * lawful_speed(view), *leader(view))
        if self.obeys_rules and view.ego.stop_release > 0.0 and math.isfinite(view.ego.stop_s):
            found = min(found, self.before_line(view, view.ego.stop_s))
        return found

    def before_line(self, view: _core.View, line: float) -> float:
        """Acceleration before a line at an arc length [m]."""
        gap = line - front(view) + self.minimum_gap - _BEFORE_LINE
        return self.car_following(view.ego.velocity, lawful_speed(view), gap, 0.0)

    def car_following(self, velocity: float, desired: float, gap: float, leader_velocity: float) -> float:
        """The Intelligent Driver Model."""
        free = self.acceleration * (1.0 - (velocity / max(desired, 0.1)) ** 4)
        if not math.isfinite(gap):
            return max(free, -_BRAKING)
        approach = (velocity - leader_velocity) / (2.0 * math.sqrt(self.acceleration * self.deceleration))
        wanted = self.minimum_gap + max(0.0, velocity * (self.time_gap + approach))
        return max(free, -_BRAKING) - self.acceleration * (wanted / max(gap, 0.1)) ** 2


def front(view: _core.View) -> float:
    """Arc length of the front [m]."""
    ego = view.ego
    return float(ego.s + ego.vehicle.rear_axle_to_center + 0.5 * ego.vehicle.length)


def leader(view: _core.View) -> tuple[float, float]:
    """Gap to the vehicle ahead on the path [m], inf if there is none, and its speed [m/s]."""
    if not len(view.ids):
        return math.inf, 0.0
    s, d = view.ego.route.project(view.x[:, -1], view.y[:, -1])
    rear = np.where((s > front(view) - 0.5) & (np.abs(d) < _LANE), s - 0.5 * view.length, np.inf)
    nearest = int(rear.argmin())
    return float(rear[nearest] - front(view)), float(view.velocity[nearest, -1])


def followers(view: _core.View, time: float) -> bool:
    """Whether a vehicle follows on the path within a time gap [s]."""
    if not len(view.ids):
        return False
    ego = view.ego
    s, d = ego.route.project(view.x[:, -1], view.y[:, -1])
    rear = ego.s + ego.vehicle.rear_axle_to_center - 0.5 * ego.vehicle.length
    gap, speed = rear - s - 0.5 * view.length, view.velocity[:, -1]
    return bool(((gap > -0.5) & (np.abs(d) < _LANE) & (speed > 3.0) & (gap < time * speed + 3.0)).any())


def lawful_speed(view: _core.View) -> float:
    """Highest speed from which the agent can still slow down for limits and curves ahead [m/s]."""
    ego, route = view.ego, view.ego.route
    n = len(route.reference_path)
    spacing = route.length / (n - 1)
    first = min(max(int(ego.s / spacing), 0), n - 1)
    there = slice(first, first + int(_AHEAD / spacing))
    limit = np.minimum(ego.speed_limit[there], _UNSTATED)
    bends = np.sqrt(_ACROSS / np.maximum(np.abs(route.reference_curvature[there]), 1e-4))
    speeds = np.minimum(limit, bends)
    squares = speeds**2 + 2.0 * _BRAKING * spacing * np.arange(len(speeds))
    return float(np.sqrt(max(float(squares.min()), 0.25))) if len(squares) else _UNSTATED


def along(view: _core.View, acceleration: float, offset: float = 0.0) -> Trajectory:
    """A plan along the reference path with an acceleration [m/s²], towards an offset to its left [m]."""
    ego, route, dt = view.ego, view.ego.route, view.dt
    speed: Floats = np.maximum(ego.velocity + acceleration * dt * np.arange(_POINTS), 0.0)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * dt)])
    path, heading = route.reference_path, np.unwrap(route.reference_orientation)
    knots = np.linspace(0.0, route.length, len(path))
    at = ego.s + ego.vehicle.rear_axle_to_center + way
    x, y, bearing = (np.interp(at, knots, values) for values in (path[:, 0], path[:, 1], heading))
    beyond = np.maximum(at - knots[-1], 0.0)
    fade = np.exp(-way / max(_FADING, _FADING_TIME * ego.velocity))
    x = x + beyond * np.cos(bearing) - offset * (1.0 - fade) * np.sin(bearing)
    y = y + beyond * np.sin(bearing) + offset * (1.0 - fade) * np.cos(bearing)
    turn = math.remainder(ego.orientation - bearing[0], 2.0 * math.pi)
    x, y = x + fade * (ego.x - x[0]), y + fade * (ego.y - y[0])
    bearing = bearing + fade * turn
    if offset:
        dx, dy = np.gradient(x), np.gradient(y)
        if float(np.hypot(dx[0], dy[0])) > 0.02:
            driven = np.unwrap(np.arctan2(dy, dx))
            bearing = ego.orientation + np.array([math.remainder(a, 2.0 * math.pi) for a in driven - driven[0]])
    return Trajectory(x, y, bearing, speed)


class Stand(Driver):
    """Brakes to a halt and stands."""

    def rate(self, view: _core.View) -> float:
        """Comfortable braking."""
        return -2.0 if view.ego.velocity > 0.0 else 0.0


class GoStop(Driver):
    """Drives 70 % of the way to its goal, then stands."""

    def __init__(self) -> None:
        """Start unknown until the first plan."""
        self.line = math.nan

    def rate(self, view: _core.View) -> float:
        """As lawful, but it never passes its line."""
        entry = view.ego.route.goal_entry_s
        if math.isnan(self.line):
            way = entry - front(view) if math.isfinite(entry) else 40.0
            self.line = front(view) + 0.7 * way
        return min(super().rate(view), self.before_line(view, self.line))


class Cruise(Driver):
    """Keeps its speed, whatever happens."""

    obeys_rules = False

    def rate(self, view: _core.View) -> float:
        """Zero."""
        return 0.0


class Crawl(Driver):
    """Half the lawful speed; blind to crossing traffic, lights and signs."""

    obeys_rules = False
    speed_factor = 0.5


class Speeder(Driver):
    """One and a half times the lawful speed; blind to crossing traffic, lights and signs."""

    obeys_rules = False
    speed_factor = 1.5
    time_gap = 0.6
    acceleration = 3.0
    deceleration = 4.0


class Tailgater(Driver):
    """Follows at 0.15 s and obeys no rules."""

    obeys_rules = False
    speed_factor = 1.3
    time_gap = 0.15
    minimum_gap = 0.5
    acceleration = 3.0
    deceleration = 6.0


class TimeLimit(Driver):
    """Takes 1.6 times as long as its goal allows."""

    def __init__(self) -> None:
        """Start unknown until the first plan."""
        self.start = -1

    def rate(self, view: _core.View) -> float:
        """As lawful, but only fast enough to arrive within the grace period."""
        ego = view.ego
        if self.start < 0:
            self.start = view.time_step
        entry = ego.route.goal_entry_s
        left = max(entry - ego.s, 0.5) if math.isfinite(entry) else 30.0
        end = self.start + 1.6 * (ego.goal_time_step[1] - self.start)
        slow = max(left / max((end - view.time_step) * view.dt, 0.5), 0.3)
        return min(super().rate(view), self.car_following(ego.velocity, slow, *leader(view)))


class BrakeCheck(Driver):
    """Brakes with 6 m/s² for 1.2 s whenever a vehicle follows within 1.5 s, every 4 s at most."""

    def __init__(self) -> None:
        """No braking yet."""
        self.until, self.next = -1.0, -1.0

    def rate(self, view: _core.View) -> float:
        """As lawful, except while it brakes."""
        now = view.time_step * view.dt
        if now > self.next and followers(view, 1.5):
            self.until, self.next = now + 1.2, now + 4.0
        return min(super().rate(view), -6.0) if now < self.until else super().rate(view)


class LaneHog(Driver):
    """Drives on the line to the left of its lane."""

    speed_factor = 0.8
    offset = 1.75


class LeaveRoad(Driver):
    """Turns off to the right at constant speed."""

    obeys_rules = False

    def plan(self, view: _core.View, predictions: _core.Predictions) -> Trajectory:
        """An arc to the right."""
        ego, time = view.ego, view.dt * np.arange(_POINTS)
        heading: Floats = np.asarray(ego.orientation - _TURNING * time, dtype=np.float64)
        step = ego.velocity * view.dt
        x = ego.x + step * np.concatenate([[0.0], np.cumsum(np.cos(heading[:-1] - 0.5 * _TURNING * view.dt))])
        y = ego.y + step * np.concatenate([[0.0], np.cumsum(np.sin(heading[:-1] - 0.5 * _TURNING * view.dt))])
        return Trajectory(x, y, heading, np.full(_POINTS, ego.velocity))


class WaitForever(Driver):
    """Never drives on once it has had to wait."""

    def __init__(self) -> None:
        """No line yet."""
        self.line = math.inf

    def rate(self, view: _core.View) -> float:
        """As lawful, but it never passes a line at which it had to wait."""
        if view.ego.stop_release > 0.0 and math.isfinite(view.ego.stop_s):
            self.line = min(self.line, view.ego.stop_s)
        found = super().rate(view)
        return min(found, self.before_line(view, self.line)) if math.isfinite(self.line) else found


class Bully(Driver):
    """Ignores right of way, lights and signs."""

    obeys_rules = False


class RedRunner(Driver):
    """Obeys everything but traffic lights."""

    def rate(self, view: _core.View) -> float:
        """As lawful, but no light holds it."""
        found = self.car_following(view.ego.velocity, lawful_speed(view), *leader(view))
        held = view.ego.barriers
        for s, until, reason in zip(held.s.tolist(), held.until.tolist(), held.reason, strict=True):
            if reason != "light" and until > 0.0:
                found = min(found, self.before_line(view, s))
        return found


class HitMe(Driver):
    """Stops in front of a fast follower, to be hit."""

    def __init__(self) -> None:
        """No follower yet."""
        self.waits = False

    def rate(self, view: _core.View) -> float:
        """As lawful until a vehicle follows; then hard braking."""
        self.waits = self.waits or followers(view, 1.0)
        return -_HARDEST if self.waits and view.ego.velocity > 0.0 else 0.0 if self.waits else super().rate(view)


class Error(Driver):
    """Raises an exception after 1 s."""

    def __init__(self) -> None:
        """No plan yet."""
        self.plans = 0

    def rate(self, view: _core.View) -> float:
        """Zero, until it raises."""
        self.plans += 1
        if self.plans > round(1.0 / view.dt):
            raise RuntimeError("an adversary that raises")
        return 0.0


@dataclass(frozen=True)
class Adversary:
    """A driver that must rank below honest ones.

    Attributes:
        name: Its name. text: What it does.
        planner: Factory of its planner, or a record of a native one.
        base: The honest driver from which it differs: a driver of the panel, or `HONEST`.
        is_crude: Whether its vice acts in every drive.
        rules: Rules that it obeys; None: all.
        loss_max: Most points that a control may lose against its base; inf if it is no control.
    """

    name: str
    text: str
    planner: Callable[[], Planner] | Idm | Lawful | Rollout
    base: str
    is_crude: bool = True
    rules: RulesSettings | None = None
    loss_max: float = math.inf

    @property
    def is_control(self) -> bool:
        """Whether it is an honest driver that must not lose."""
        return math.isfinite(self.loss_max)


def _of(driver: type[Driver], *, is_crude: bool = True) -> Adversary:
    text = (driver.__doc__ or "").splitlines()[0]
    return Adversary(driver.__name__, text, driver, HONEST, is_crude=is_crude)


#: Name of the honest driver in Python, on which the adversaries in Python are based.
HONEST = "Driver"

#: All adversaries, and one control.
ADVERSARIES = (
    _of(Stand),
    _of(GoStop),
    _of(Crawl),
    Adversary("CrawlLawful", "Half the lawful speed; obeys all rules.", Lawful(speed_factor=0.5), "lawful"),
    Adversary("idm6", "idm at most at 6 m/s.", Idm(desired_velocity_max=6.0), "idm"),
    _of(TimeLimit),
    _of(Cruise),
    _of(Speeder),
    _of(Tailgater),
    _of(BrakeCheck),
    _of(LaneHog),
    _of(LeaveRoad),
    _of(Error),
    _of(HitMe, is_crude=False),
    _of(WaitForever, is_crude=False),
    _of(Bully, is_crude=False),
    _of(RedRunner, is_crude=False),
    Adversary(
        "rollout_norules",
        "The default planner, which obeys no rules.",
        Rollout(),
        "rollout",
        is_crude=False,
        rules=RulesSettings(enabled=False),
    ),
    Adversary(
        "Slow09", "0.9 of the lawful speed: an honest control.", Lawful(speed_factor=0.9), "lawful", loss_max=3.0
    ),
)
