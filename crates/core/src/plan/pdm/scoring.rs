//! What a tracked proposal is worth: gates times a weighted mean, after the closed-loop benchmark of nuPlan.

use super::super::PlanRequest;
use super::super::driven_point::DrivenPoint;
use super::comfort::is_comfortable;
use super::forecast::{Body, Forecast};
use super::settings::PdmWeights;
use crate::geometry::Point;
use crate::geometry::shape::OrientedBox;

/// Slower vehicles stand [m/s], as in the published scoring.
const STANDING: f64 = 5e-3;
/// Another participant is ahead within this angle to the heading, and behind beyond that one (cosines of 30, 150 degrees).
const AHEAD_COSINE: f64 = 0.866_025_403_784_438_6;
const BEHIND_COSINE: f64 = -AHEAD_COSINE;
/// The vehicle moves on by this at most [s], in this many equal times.
const TTC_TIME: f64 = 0.9;
const TTC_LOOKS: usize = 3;
/// Ways against the lanes [m] up to which the direction is right, and above which it is wrong.
const AGAINST: (f64, f64) = (2.0, 6.0);
/// Nearer to the path the vehicle is in the path's lane [m].
const IN_LANE: f64 = 1.2;
/// Shorter ways are no progress [m].
const PROGRESS_MIN: f64 = 0.1;

/// A proposal as it is judged alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Judgement {
    /// 0 with a contact at fault, 1/2 with a thing.
    pub(super) collision: f64,
    /// 0 if it leaves the road.
    pub(super) road: f64,
    /// 1, 1/2 or 0.
    pub(super) direction: f64,
    /// Way along the path [m].
    pub(super) way: f64,
    pub(super) ttc: f64,
    pub(super) comfort: f64,
    /// The first contact at fault: time [s], and position in the request's `others`.
    pub(super) hit: Option<(f64, usize)>,
}

impl Judgement {
    /// The product of its gates.
    pub(super) fn gates(&self) -> f64 {
        self.collision * self.road * self.direction
    }

    /// Its score from 0 to 1, given the longest admissible way [m].
    pub(super) fn score(&self, weights: &PdmWeights, longest: f64) -> f64 {
        let sum = weights.progress + weights.ttc + weights.comfort;
        let quality =
            weights.progress * self.progress(longest) + weights.ttc * self.ttc + weights.comfort * self.comfort;
        self.gates() * if sum > 0.0 { quality / sum } else { 1.0 }
    }

    /// Its share of the longest admissible way [m].
    pub(super) fn progress(&self, longest: f64) -> f64 {
        let gates = self.gates();
        if longest > PROGRESS_MIN {
            self.way * gates / longest
        } else if gates > 0.0 {
            1.0
        } else {
            0.0
        }
    }
}

/// The longest way of all proposals, as far as their gates admit it [m].
pub(super) fn longest(judged: &[Judgement]) -> f64 {
    judged.iter().map(|one| one.way * one.gates()).fold(0.0, f64::max)
}

/// Judges tracked proposals; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Judge {
    /// Bodies that the proposal has met without fault.
    met: Vec<bool>,
    /// The same for contacts of the vehicle moved on.
    near: Vec<bool>,
}

impl Judge {
    pub(super) fn judge(
        &mut self,
        request: &PlanRequest,
        forecast: &Forecast,
        points: &[DrivenPoint],
        step: f64,
    ) -> Judgement {
        let road = if self.stays_on_road(request, points) { 1.0 } else { 0.0 };
        let (collision, ttc, hit) = self.contacts(request, forecast, points, step);
        let (first, last) = (points[0], points[points.len() - 1]);
        Judgement {
            collision,
            road,
            direction: direction(request, points),
            way: (last.s - first.s).max(0.0),
            ttc,
            comfort: if is_comfortable(points, step) { 1.0 } else { 0.0 },
            hit,
        }
    }

    fn stays_on_road(&mut self, request: &PlanRequest, points: &[DrivenPoint]) -> bool {
        let mut was_on_road = request.was_on_road;
        points.iter().all(|point| {
            let footprint = point.footprint(request);
            let stays = !was_on_road || request.road.admits_box(request.vehicle, &footprint);
            was_on_road = was_on_road || request.road.box_is_covered(&footprint);
            stays
        })
    }

    /// The factor of contacts, that of contacts that are near, and the first contact at fault.
    fn contacts(
        &mut self,
        request: &PlanRequest,
        forecast: &Forecast,
        points: &[DrivenPoint],
        step: f64,
    ) -> (f64, f64, Option<(f64, usize)>) {
        let touching = forecast.bodies.iter().map(|body| body.touches);
        self.met.clear();
        self.met.extend(touching);
        self.near.clone_from(&self.met);
        let radius = 0.5 * request.vehicle.length.hypot(request.vehicle.width);
        let (mut collision, mut ttc, mut hit) = (1.0_f64, 1.0, None);
        for (i, point) in points.iter().enumerate() {
            let time = i as f64 * step;
            let motion = point.axis * point.velocity;
            for (index, body) in forecast.bodies.iter().enumerate() {
                let closing = (motion - body.motion).norm();
                let apart = (body.now.center + body.motion * time - point.center).norm();
                if apart > radius + body.radius + closing * TTC_TIME {
                    continue;
                }
                let own = point.footprint(request);
                let meets = |lag: f64| {
                    let moved = OrientedBox { center: own.center + motion * lag, ..own };
                    moved.overlaps(&body.at(time + lag))
                };
                if !self.met[index] && meets(0.0) {
                    if is_at_fault(request, point, body, &body.at(time)) {
                        collision = collision.min(if body.is_road_user { 0.0 } else { 0.5 });
                        hit = hit.or(Some((time, body.other)));
                    } else {
                        self.met[index] = true;
                    }
                }
                if self.near[index] || ttc == 0.0 || point.velocity < STANDING {
                    continue;
                }
                for look in 0..=TTC_LOOKS {
                    let lag = TTC_TIME * look as f64 / TTC_LOOKS as f64;
                    if !meets(lag) {
                        continue;
                    }
                    let cosine = bearing(request, point, body.at(time + lag).center);
                    if cosine > AHEAD_COSINE || cosine >= BEHIND_COSINE && is_between_lanes(request, point, true) {
                        ttc = 0.0;
                    } else {
                        self.near[index] = true;
                    }
                    break;
                }
            }
        }
        (collision, ttc, hit)
    }
}

/// Cosine of the angle between the heading and the way from the rear axle to a place.
fn bearing(request: &PlanRequest, point: &DrivenPoint, place: Point) -> f64 {
    let way = place - (point.center - point.axis * request.vehicle.rear_axle_to_center);
    point.axis.dot(way) / way.norm().max(1e-9)
}

/// A contact is the vehicle's fault if it moves and hits what stands, or hits with its front what is not behind it, or with
/// its side while it is between lanes.
fn is_at_fault(request: &PlanRequest, point: &DrivenPoint, body: &Body, place: &OrientedBox) -> bool {
    if point.velocity < STANDING {
        return false;
    }
    if body.speed < STANDING {
        return true;
    }
    if bearing(request, point, place.center) < BEHIND_COSINE {
        return false;
    }
    let front = point.center + point.axis * (0.5 * request.vehicle.length);
    let side = point.axis.left() * (0.5 * request.vehicle.width);
    place.overlaps_segment(front - side, front + side) || is_between_lanes(request, point, false)
}

/// The footprint is in several lanes and in none as a whole, or beside the road; or, where junctions count, its rear axle
/// is where lanes overlap.
fn is_between_lanes(request: &PlanRequest, point: &DrivenPoint, junctions_count: bool) -> bool {
    let road = request.road;
    let corners = point.footprint(request).corners().map(|corner| road.lanelets_at(corner));
    let holds_all = |lanelet: &usize| corners.iter().all(|lanes| lanes.contains(lanelet));
    let is_beside = corners.iter().any(Vec::is_empty);
    if is_beside || !corners[0].iter().any(holds_all) {
        return true;
    }
    let axle = point.center - point.axis * request.vehicle.rear_axle_to_center;
    junctions_count && road.lanelets_at(axle).len() > 1
}

/// 1, 1/2 or 0, by the longest way against the lanes.
fn direction(request: &PlanRequest, points: &[DrivenPoint]) -> f64 {
    let (mut longest, mut way) = (0.0_f64, 0.0);
    for pair in points.windows(2) {
        let point = &pair[1];
        let pose = crate::geometry::Pose { position: point.center, orientation: point.theta };
        let is_against = point.d.abs() > IN_LANE && request.road.lane_rules(pose).0.is_nan();
        way = if is_against { way + pair[0].center.distance(point.center) } else { 0.0 };
        longest = longest.max(way);
    }
    if longest < AGAINST.0 {
        1.0
    } else if longest < AGAINST.1 {
        0.5
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::super::settings::PdmSettings;
    use super::{Judgement, longest};

    const FINE: Judgement =
        Judgement { collision: 1.0, road: 1.0, direction: 1.0, way: 40.0, ttc: 1.0, comfort: 1.0, hit: None };

    #[test]
    fn a_score_is_the_product_of_gates_and_a_weighted_mean() {
        let weights = PdmSettings::default().weights;
        let score = |one: Judgement, longest: f64| one.score(&weights, longest);
        assert_eq!(score(FINE, 40.0), 1.0);
        assert_eq!(score(FINE, 80.0), (2.5 + 5.0 + 2.0) / 12.0);
        assert_eq!(score(Judgement { ttc: 0.0, ..FINE }, 40.0), 7.0 / 12.0);
        assert_eq!(score(Judgement { comfort: 0.0, ..FINE }, 40.0), 10.0 / 12.0);
        // A gate lowers the progress, too.
        assert_eq!(score(Judgement { direction: 0.5, ..FINE }, 40.0), 0.5 * (2.5 + 5.0 + 2.0) / 12.0);
        assert_eq!(score(Judgement { road: 0.0, ..FINE }, 40.0), 0.0);
        // Where nothing gets on, standing is no fault.
        assert_eq!(score(Judgement { way: 0.0, ..FINE }, 0.05), 1.0);
    }

    #[test]
    fn the_longest_way_is_that_of_an_admissible_proposal() {
        let judged = [Judgement { collision: 0.0, way: 60.0, ..FINE }, Judgement { way: 30.0, ..FINE }];
        assert_eq!(longest(&judged), 30.0);
    }
}
