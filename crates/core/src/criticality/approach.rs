//! How near a participant comes to others at one time, and one after the other at one place.

use super::traffic::Traffic;
use crate::geometry::Point;

/// How near a participant comes to all others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Approach {
    /// Smallest distance of centres, less half of both lengths [m]; infinite where nobody is there at the same time.
    pub distance: f64,
    /// Fewest time steps between it and another one within half of both widths of the same place, if there are any.
    pub steps_between: Option<usize>,
}

/// The nearest approach of a row of the traffic to all others.
///
/// # Arguments
/// * `sizes` - length and width of every row \[m\].
/// * `steps_most` - more time steps between two at one place are none.
pub fn approach(traffic: &Traffic, row: usize, sizes: &[(f64, f64)], steps_most: usize) -> Approach {
    let n = traffic.states.n_steps;
    let mut found = Approach { distance: f64::INFINITY, steps_between: None };
    for other in (0..traffic.states.ids.len()).filter(|other| *other != row) {
        let length = 0.5 * (sizes[row].0 + sizes[other].0);
        for column in (0..n).filter(|column| traffic.is_there(row, *column) && traffic.is_there(other, *column)) {
            let apart = traffic.position(row, column) - traffic.position(other, column);
            found.distance = found.distance.min(apart.x.hypot(apart.y) - length);
        }
        let width = 0.5 * (sizes[row].1 + sizes[other].1);
        // Only fewer steps than are known are of interest.
        let most = found.steps_between.map_or(Some(steps_most), |steps| steps.checked_sub(1));
        if let Some(steps) = most.and_then(|most| steps_between(traffic, (row, other), width, most)) {
            found.steps_between = Some(steps);
        }
    }
    found
}

/// Fewest time steps, up to a number, between two rows within a distance of the same place \[m\].
fn steps_between(traffic: &Traffic, (row, other): (usize, usize), width: f64, most: usize) -> Option<usize> {
    let n = traffic.states.n_steps;
    let (low, high) = bounds(traffic, row)?;
    let mut fewest = None;
    for column in (0..n).filter(|column| traffic.is_there(other, *column)) {
        let there = traffic.position(other, column);
        let is_inside =
            (low.x - width..=high.x + width).contains(&there.x) && (low.y - width..=high.y + width).contains(&there.y);
        if !is_inside {
            continue;
        }
        let is_same = |own: usize| {
            traffic.is_there(row, own) && (traffic.position(row, own) - there).norm_squared() <= width * width
        };
        let reach = fewest.map_or(Some(most), |steps: usize| steps.checked_sub(1))?;
        let touches = |steps: &usize| {
            column.checked_sub(*steps).is_some_and(is_same) || (column + steps < n && is_same(column + steps))
        };
        fewest = (0..=reach).find(touches).or(fewest);
        if fewest == Some(0) {
            break;
        }
    }
    fewest
}

/// The corners of the box around all positions of a row; `None` where it is never there.
fn bounds(traffic: &Traffic, row: usize) -> Option<(Point, Point)> {
    let (first, last) = traffic.span(row)?;
    let start = traffic.position(row, first);
    let there =
        (first..=last).filter(|column| traffic.is_there(row, *column)).map(|column| traffic.position(row, column));
    Some(there.fold((start, start), |(low, high), at| {
        (Point::new(low.x.min(at.x), low.y.min(at.y)), Point::new(high.x.max(at.x), high.y.max(at.y)))
    }))
}
