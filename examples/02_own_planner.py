"""A custom planner, which keeps to the middle of its route and its distance to the vehicle ahead."""

import numpy as np

import interdrive as idr
from interdrive.testing import check_planner


class Follow:
    """Brakes as hard as needed to stop 3 m behind the nearest participant on the reference path."""

    parallel = True  # its objects know nothing of each other: they may run in processes of their own

    def __init__(self, cruise: float = 10.0) -> None:
        """With a cruising speed [m/s]."""
        self.cruise = cruise

    def plan(self, view: idr.View, predictions: idr.Predictions) -> idr.Trajectory:
        """A trajectory of 3 s with constant acceleration."""
        ego, route = view.ego, view.ego.route
        front = ego.s + ego.vehicle.rear_axle_to_center + 0.5 * ego.vehicle.length
        s, d = route.project(view.x[:, -1], view.y[:, -1])
        ahead = (s > front) & (np.abs(d) < 2.0)
        gap = np.min(s[ahead] - 0.5 * view.length[ahead] - front, initial=np.inf) - 3.0
        braking = -(ego.velocity**2) / (2.0 * gap) if gap > 0.1 else -8.0
        acceleration = min(max(braking, -8.0), 1.5) if gap < 40.0 else np.clip(self.cruise - ego.velocity, -2.0, 1.5)

        time = np.arange(31) * view.dt
        moving = np.where(ego.velocity + acceleration * time > 0.0, time, -ego.velocity / min(acceleration, -1e-9))
        velocity = ego.velocity + acceleration * moving
        along = ego.velocity * moving + 0.5 * acceleration * moving**2

        path, heading = route.reference_path, np.unwrap(route.reference_orientation)
        knots = np.linspace(0.0, route.length, len(path))
        at = ego.s + ego.vehicle.rear_axle_to_center + along
        x, y, theta = (np.interp(at, knots, values) for values in (path[:, 0], path[:, 1], heading))
        fade = np.exp(-along / 10.0)  # from where it is onto the path
        turn = np.angle(np.exp(1j * (ego.orientation - theta[0])))
        return idr.Trajectory(x + fade * (ego.x - x[0]), y + fade * (ego.y - y[0]), theta + fade * turn, velocity)


def main() -> None:
    print(check_planner(Follow))
    run = idr.simulate("t_junction", agents="all", planner={"default": "rollout", 1002: Follow})
    row = list(run.outcomes.agent_id).index(1002)
    print(f"agent 1002 with a planner of its own: {run.outcomes.outcome[row]}")


if __name__ == "__main__":
    main()
