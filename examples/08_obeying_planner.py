"""A custom planner that obeys the rules of the road: limits, lights, stop signs, crosswalks, orders at junctions."""

import numpy as np

import interdrive as idr
from interdrive.testing import check_planner


class Obeys:
    """Follows its reference path by the Intelligent Driver Model, and takes what holds it for a standing vehicle."""

    parallel = True  # its objects know nothing of each other: they may run in processes of their own
    obeys_rules = True  # it stops where it is told to, and others rely on that

    def __init__(self, cruise: float = 14.0) -> None:
        """With a cruising speed [m/s]."""
        self.cruise = cruise

    def plan(self, view: idr.View, predictions: idr.Predictions) -> idr.Trajectory:
        """A trajectory of 3 s; a vehicle ahead is expected to keep its speed along the path, at least 0."""
        ego, route, dt = view.ego, view.ego.route, view.dt
        path, heading = route.reference_path, np.unwrap(route.reference_orientation)
        knots = np.linspace(0.0, route.length, len(path))
        to_front = 0.5 * ego.vehicle.length
        s, d = route.project(view.x[:, -1], view.y[:, -1])
        center = ego.s + ego.vehicle.rear_axle_to_center
        is_ahead = (s > center) & (np.abs(d) < 2.0)
        rears = np.where(is_ahead, s - 0.5 * view.length, np.inf)
        leader = int(np.argmin(rears)) if is_ahead.any() else None
        # An oncoming or crossing vehicle does not drive away.
        away = np.maximum(0.0, view.velocity[:, -1] * np.cos(view.orientation[:, -1] - np.interp(s, knots, heading)))

        along, velocity = [0.0], [ego.velocity]
        for step in range(30):
            front, v = center + to_front + along[-1], velocity[-1]
            limit = min(self.cruise, float(np.interp(front, knots, ego.speed_limit)))
            gaps: list[tuple[float, float]] = []  # with the speeds of what is ahead
            if leader is not None:
                gaps.append((rears[leader] + away[leader] * step * dt - front, away[leader]))
            closed = ego.barriers.s[step * dt < ego.barriers.until]
            gaps.extend((s + 1.5 - front, 0.0) for s in closed)  # a gap of 2 m is 0.5 m before the line
            wanted = [2.0 + max(0.0, v + v * (v - other) / 4.0) for _, other in gaps]
            pressure = max((w / max(gap, 0.1) for w, (gap, _) in zip(wanted, gaps, strict=True)), default=0.0)
            acceleration = np.clip(2.0 * (1.0 - (v / limit) ** 4 - pressure**2), -6.0, 1.5)
            velocity.append(max(0.0, v + acceleration * dt))
            along.append(along[-1] + 0.5 * (v + velocity[-1]) * dt)

        way = np.array(along)
        x, y, theta = (np.interp(center + way, knots, values) for values in (path[:, 0], path[:, 1], heading))
        fade = np.exp(-way / 10.0)  # from where it is onto the path
        turn = np.angle(np.exp(1j * (ego.orientation - theta[0])))
        return idr.Trajectory(
            x + fade * (ego.x - x[0]), y + fade * (ego.y - y[0]), theta + fade * turn, np.array(velocity)
        )


def main() -> None:
    print(check_planner(Obeys))
    run = idr.simulate("signals", agents="all", planner=Obeys)
    outcomes = [outcome.startswith("goal_reached") for outcome in run.outcomes.outcome]
    broken = sum(source == "agent" for source in run.violations.source)
    print(f"{sum(outcomes)} of {len(outcomes)} agents reached their goal, {broken} broke a rule")


if __name__ == "__main__":
    main()
