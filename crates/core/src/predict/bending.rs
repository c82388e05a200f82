//! Spread in bends. A normal distribution is straight, so in a bend its tails along the way lie beside the lane.

use super::waiting::narrowed;
use crate::geometry::{Point, wrap_angle};
use crate::trajectory::Predictions;

/// Largest distance beside a bend to which twice the standard deviation along the way may lead [m].
const SPREAD_OFFSET_MAX: f64 = 0.5;
/// Half the interval over which the curvature is measured [s].
const CURVATURE_INTERVAL: f64 = 0.3;
/// Ways with less curvature are straight [1/m].
const STRAIGHT_CURVATURE: f64 = 0.01;
/// Over less than this [m] no curvature can be told.
const WAY_MIN: f64 = 0.1;

/// Narrows the spread along the way of all modes of a row where they bend: a standard deviation s along a bend of
/// curvature k lies 0.5 k (2 s)² beside it at twice its length.
pub fn narrow_in_bends(table: &mut Predictions, row: usize, dt: f64) {
    let steps = ((CURVATURE_INTERVAL / dt).round() as usize).max(1);
    for mode in 0..table.n_modes {
        if table.probability[row * table.n_modes + mode] <= 0.0 {
            continue;
        }
        let start = table.offset(row, mode);
        let n = (start..start + table.n_steps).take_while(|i| table.valid[*i]).count();
        for k in 0..n {
            let (a, b) = (start + k.saturating_sub(steps), start + (k + steps).min(n - 1));
            let way = Point::new(table.x[b] - table.x[a], table.y[b] - table.y[a]).norm();
            let turned = wrap_angle(table.orientation[b] - table.orientation[a]).abs();
            if way < WAY_MIN || turned <= STRAIGHT_CURVATURE * way {
                continue;
            }
            let (i, spread) = (start + k, (0.5 * SPREAD_OFFSET_MAX * way / turned).sqrt());
            let covariance = (table.covariance_xx[i], table.covariance_xy[i], table.covariance_yy[i]);
            (table.covariance_xx[i], table.covariance_xy[i], table.covariance_yy[i]) =
                narrowed(covariance, table.orientation[i], spread);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose;

    /// 3 s at 5 m/s on a circle of this radius [m], 2 m of spread along the way and 0.4 m across.
    fn expected(radius: f64) -> Predictions {
        let mut table = Predictions::empty(0, vec![7], 1, 30);
        table.probability[0] = 1.0;
        for k in 0..30 {
            let turned = 0.5 * (k + 1) as f64 / radius;
            let Point { x, y } = Point::from_angle(turned);
            let pose = Pose::new(radius * y, radius * (1.0 - x), turned);
            let (along, across) = (4.0, 0.16);
            let covariance = (along * x * x + across * y * y, (along - across) * x * y, along * y * y + across * x * x);
            crate::predict::write(&mut table, k, pose, 5.0, covariance);
        }
        table
    }

    /// Standard deviations along the way and across, at the last step but some [m].
    fn spreads(table: &Predictions) -> (f64, f64) {
        let i = 20;
        let (xx, xy, yy) = (table.covariance_xx[i], table.covariance_xy[i], table.covariance_yy[i]);
        let of = |u: Point| (u.x * u.x * xx + 2.0 * u.x * u.y * xy + u.y * u.y * yy).sqrt();
        let along = Point::from_angle(table.orientation[i]);
        (of(along), of(along.left()))
    }

    #[test]
    fn in_a_bend_the_spread_along_the_way_stays_in_the_lane() {
        let mut table = expected(10.0);
        narrow_in_bends(&mut table, 0, 0.1);
        let (along, across) = spreads(&table);
        // sqrt(0.5 m · 10 m / 2) = 1.58 m: 0.5 · 0.1 1/m · (3.16 m)² = 0.5 m beside the bend.
        assert!((along - 1.58).abs() < 0.02, "{along} m");
        assert!((across - 0.4).abs() < 1e-9, "{across} m");
    }

    #[test]
    fn on_a_wide_bend_and_where_the_spread_is_small_it_stays() {
        let mut table = expected(200.0);
        let before = table.clone();
        narrow_in_bends(&mut table, 0, 0.1);
        assert_eq!(table, before);
        let mut table = expected(20.0);
        let before = table.clone();
        narrow_in_bends(&mut table, 0, 0.1);
        // sqrt(0.5 m · 20 m / 2) = 2.24 m.
        assert_eq!(table, before);
    }
}
