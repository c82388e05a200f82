"""A custom predictor: turning vehicles keep turning. It is checked, compared on recordings, and used in a run."""

import numpy as np

import interdrive as idr
from interdrive.testing import check_predictor


class Turning:
    """Constant speed and constant yaw rate, taken from the last half second; two modes: it goes on so, or straight."""

    def predict(self, scene: idr.Scene) -> idr.Predictions:
        """Predictions for all participants present, 3 s ahead."""
        n, steps = len(scene.ids), round(3.0 / scene.dt)
        time = scene.dt * np.arange(1, steps + 1)
        heading = scene.orientation[:, -1]
        speed = np.where(scene.is_static, 0.0, scene.velocity[:, -1])

        back = min(scene.orientation.shape[1] - 1, round(0.5 / scene.dt))
        before = scene.orientation[:, -1 - back]
        turned = np.where(np.isnan(before), 0.0, np.angle(np.exp(1j * (heading - before))))
        yaw_rate = turned / max(back * scene.dt, scene.dt)

        rates = np.stack([yaw_rate, 0.0 * yaw_rate], axis=1)  # (participants, modes)
        orientation = heading[:, None, None] + rates[:, :, None] * time
        step = speed[:, None, None] * scene.dt * np.exp(1j * (orientation - 0.5 * rates[:, :, None] * scene.dt))
        position = (scene.x[:, -1] + 1j * scene.y[:, -1])[:, None, None] + np.cumsum(step, axis=2)

        moves = np.minimum(np.abs(speed) / 5.0, 1.0)[:, None, None]
        along, across = (0.2 + moves * rate * time**power for rate, power in ((0.5, 2), (0.3, 1)))
        axis = np.stack([np.cos(orientation), np.sin(orientation)], axis=-1)
        side = np.stack([-axis[..., 1], axis[..., 0]], axis=-1)
        covariance = sum(
            sigma[..., None, None] ** 2 * way[..., :, None] * way[..., None, :]
            for sigma, way in ((along, axis), (across, side))
        )
        return idr.Predictions(
            scene.time_step,
            scene.ids,
            probability=np.tile([0.7, 0.3], (n, 1)),
            x=position.real,
            y=position.imag,
            orientation=orientation,
            velocity=np.broadcast_to(speed[:, None, None], position.shape),
            covariance=covariance,
            valid=np.ones(position.shape, dtype=bool),
        )


def main() -> None:
    check_predictor(Turning)
    found = idr.evaluate_predictors("t_junction", ["constant_velocity", Turning])
    for row in found.table.to_pylist():
        if (row["category"], row["traffic"]) == ("junction", "all"):
            print(f"{row['predictor']}: {row['fde_3']:.2f} m after 3 s, best mode {row['fde_best_3']:.2f} m")
    run = idr.simulate("t_junction", predictor=Turning)
    in_time, late = (run.outcomes.outcome.count(name) for name in ("goal_reached", "goal_reached_late"))
    print(f"with this predictor {in_time + late} of {len(run.outcomes.outcome)} agents reach their goal, {late} late")


if __name__ == "__main__":
    main()
