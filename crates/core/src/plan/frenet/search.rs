//! The search for the best sample: trajectories in the world, tests in the order of their price, costs.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::super::PlanRequest;
use super::super::frame::Waypoint;
use super::Problem;
use super::cost::{FrenetMotion, TableCosts, has_world_terms, weighted_world_terms, world_terms};
use super::feasibility::Rejection;
use super::grid::SampleGrid;
use super::obstacles::{Contact, Obstacles};
use super::settings::{N_TABLE_TERMS, N_TERMS, N_WORLD_TERMS};
use crate::collision::departs_road;
use crate::geometry::Point;
use crate::geometry::shape::OrientedBox;
use crate::trajectory::Obstruction;

/// Memory of the evaluations of one plan.
#[derive(Debug, Clone, Default)]
pub(super) struct EvaluationMemory {
    samples: SampleGrid,
    costs: TableCosts,
    obstacles: Obstacles,
    queue: BinaryHeap<Reverse<Entry>>,
    points: Vec<Waypoint>,
    /// Trajectories that were found to be drivable.
    n_trajectories: usize,
}

/// A sample in the queue: the bits of its cost or a lower bound of it, which are in order because neither is negative; its
/// number; the cost is complete.
type Entry = (u64, usize, bool);

/// Everything about one plan.
pub(super) struct Evaluation<'a> {
    pub(super) problem: &'a Problem<'a>,
    memory: &'a mut EvaluationMemory,
    /// The footprint is larger by this on all sides when the road is examined [m].
    road_margin: f64,
}

impl<'a> Evaluation<'a> {
    /// With all that the samples share.
    pub(super) fn new(problem: &'a Problem, memory: &'a mut EvaluationMemory) -> Self {
        let Problem { request, settings, .. } = *problem;
        memory.samples.generate(problem);
        memory.costs.prepare(&memory.samples, problem);
        memory.obstacles.prepare(problem, &memory.samples);
        memory.n_trajectories = 0;
        let footprint = OrientedBox::new(request.state.pose(), request.vehicle.length, request.vehicle.width);
        let (road, vehicle, margin) = (request.road, request.vehicle, settings.road_margin);
        let has_room = request.was_on_road && road.admits_box(vehicle, &footprint.grown(margin));
        Self { problem, memory, road_margin: if has_room { margin } else { 0.0 } }
    }

    /// Trajectories that were found to be drivable.
    pub(super) fn n_trajectories(&self) -> usize {
        self.memory.n_trajectories
    }

    pub(super) fn samples(&self) -> &SampleGrid {
        &self.memory.samples
    }

    /// The trajectory that was written last.
    pub(super) fn points(&self) -> &[Waypoint] {
        &self.memory.points
    }

    /// The admissible sample with the smallest (cost, number) and its cost.
    ///
    /// Terms of the grid alone are lower bounds of the costs. A sample is only returned when its cost is complete and those of
    /// all others are larger, so the result is that of `exhaustive`.
    pub(super) fn best_first(&mut self) -> Option<(usize, f64)> {
        let mut entries = std::mem::take(&mut self.memory.queue).into_vec();
        entries.clear();
        let finite = self.memory.costs.bounds.iter().enumerate().filter(|(_, bound)| bound.is_finite());
        entries.extend(finite.map(|(sample, bound)| Reverse((bound.to_bits(), sample, false))));
        self.memory.queue = BinaryHeap::from(entries);
        while let Some(Reverse((bits, sample, is_complete))) = self.memory.queue.pop() {
            if !is_complete {
                let cost = self.cost(sample);
                self.memory.queue.extend(cost.map(|cost| Reverse((cost.to_bits(), sample, true))));
            } else if self.write(sample) == Rejection::Admissible && self.stays_on_road() {
                return Some((sample, f64::from_bits(bits)));
            }
        }
        None
    }

    /// The same by evaluating every sample to its end.
    pub(super) fn exhaustive(&mut self) -> Option<(usize, f64)> {
        let all = 0..self.memory.samples.len();
        let costs = all.filter_map(|sample| {
            let cost = self.cost(sample).filter(|_| self.stays_on_road())?;
            Some((sample, cost))
        });
        costs.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The cost of a sample that passes all tests but that of the road.
    fn cost(&mut self, sample: usize) -> Option<f64> {
        let bound = self.memory.costs.bounds[sample];
        if bound == f64::INFINITY || self.write(sample) != Rejection::Admissible {
            return None;
        }
        self.memory.n_trajectories += 1;
        if self.contact().is_some() {
            return None;
        }
        let weights = &self.problem.settings.weights;
        let mut cost = bound;
        if has_world_terms(weights) {
            cost += weighted_world_terms(weights, &self.world_terms(sample));
        }
        Some(cost + weights.prediction * self.prediction_term())
    }

    /// Writes the trajectory of a sample and returns its fault. Points that are undefined (near the centre of the
    /// path's curvature) repeat the one before.
    pub(super) fn write(&mut self, sample: usize) -> Rejection {
        let Problem { request, limits, .. } = self.problem;
        let EvaluationMemory { samples, points, .. } = &mut *self.memory;
        points.clear();
        let mut found = samples.profiles[samples.cell(sample).0].rejection;
        for i in 0..limits.n_points {
            let (s, frenet) = samples.at(sample, i);
            let point = Waypoint::new(&request.route.path.at(s), &frenet, request.vehicle.rear_axle_to_center);
            let before = points.last().copied();
            let fault = match (point, before) {
                (None, _) => Rejection::LeftPath,
                (Some(point), Some(before)) => limits.check(&before, &point, i),
                (Some(_), None) => Rejection::Admissible,
            };
            found = found.or(fault);
            points.push(point.or(before).unwrap_or_default());
        }
        found
    }

    /// Writes a sample; what is wrong with it, and its first contact.
    pub(super) fn examine(&mut self, sample: usize) -> (Rejection, Option<Contact>) {
        let rejection = self.write(sample);
        if rejection != Rejection::Admissible {
            return (rejection, None);
        }
        match self.contact() {
            None if self.stays_on_road() => (Rejection::Admissible, None),
            None => (Rejection::OffRoad, None),
            contact => (Rejection::Collision, contact),
        }
    }

    /// First contact of the trajectory that was written last.
    fn contact(&mut self) -> Option<Contact> {
        let EvaluationMemory { obstacles, points, .. } = &mut *self.memory;
        obstacles.first_contact(points, self.problem.request)
    }

    /// The footprint (with margin) of the trajectory that was written last stays on the road, at the points and between them;
    /// an agent that starts (partly) beside it must do so once it is back. Without margin the first step, which will be
    /// driven, is examined as closely as the world does.
    fn stays_on_road(&self) -> bool {
        let PlanRequest { road, shape, state, vehicle, mut was_on_road, .. } = *self.problem.request;
        let points = self.points();
        let is_exact = was_on_road && self.road_margin == 0.0;
        if is_exact && departs_road(road, shape, vehicle, state.pose(), points[1].pose()).is_some() {
            return false;
        }
        let half_length = 0.5 * vehicle.length + self.road_margin;
        let half_width = 0.5 * vehicle.width + self.road_margin;
        let footprint = |p: &Waypoint| OrientedBox { center: p.center, axis: p.axis, half_length, half_width };
        points.windows(2).skip(usize::from(is_exact)).all(|pair| {
            let (from, to) = (footprint(&pair[0]), footprint(&pair[1]));
            if was_on_road {
                return road.admits_motion(vehicle, &from, &to);
            }
            was_on_road = road.box_is_covered(&to);
            true
        })
    }

    /// Terms of the cost that need the trajectory that was written last.
    fn world_terms(&self, sample: usize) -> [f64; N_WORLD_TERMS] {
        let EvaluationMemory { samples, obstacles, points, .. } = &*self.memory;
        let (profile, end_offset) = samples.cell(sample);
        let motion = |i: usize| {
            let d = samples.beside(profile)[i].to(end_offset);
            FrenetMotion::new(&samples.motion(profile)[i], d, samples.profiles[profile].is_over_arc)
        };
        let request = self.problem.request;
        world_terms(points, motion, obstacles.distance_cost(points, request), request.dt)
    }

    /// The prediction term of the trajectory that was written last.
    fn prediction_term(&self) -> f64 {
        let points = self.points().iter().enumerate().skip(1);
        points.map(|(i, point)| self.memory.obstacles.prediction_cost(point, i)).sum()
    }

    /// All terms of the cost of the sample that was written last.
    pub(super) fn terms(&self, sample: usize) -> [f64; N_TERMS] {
        let mut terms = [0.0; N_TERMS];
        terms[..N_TABLE_TERMS].copy_from_slice(&self.memory.costs.terms[sample]);
        terms[N_TABLE_TERMS..N_TERMS - 1].copy_from_slice(&self.world_terms(sample));
        terms[N_TERMS - 1] = self.prediction_term();
        terms
    }

    /// Why no sample is admissible: what rejected most of the samples that the vehicle can drive. Contacts with one participant
    /// count together; the first of equals counts.
    pub(super) fn obstruction(&mut self) -> Obstruction {
        let request = self.problem.request;
        let mut hits = vec![(0_usize, None); request.others.len()];
        let mut counts = [(0_usize, Rejection::Admissible); Rejection::StopLine as usize + 1];
        let mut off_road: Option<(f64, usize)> = None;
        for sample in 0..self.samples().len() {
            let (rejection, contact) = self.examine(sample);
            counts[rejection as usize] = (counts[rejection as usize].0 + 1, rejection);
            if let Some(contact) = contact {
                let (n, first) = &mut hits[contact.other];
                *n += 1;
                first.get_or_insert(self.points()[contact.interval + 1].center);
            } else if rejection == Rejection::OffRoad {
                let cost = self.cost(sample).unwrap_or(f64::INFINITY);
                if off_road.is_none_or(|(least, _)| cost < least) {
                    off_road = Some((cost, sample));
                }
            }
        }
        let (n_hits, other) = first_of_most(hits.iter().map(|(n, _)| *n));
        if let Some((_, sample)) = off_road.filter(|_| counts[Rejection::OffRoad as usize].0 > n_hits) {
            return self.obstructing_edge(sample);
        }
        if n_hits > 0 {
            let words = Rejection::Collision.words(request.predictions.ids[request.others[other].row]);
            return Obstruction { at: hits[other].1.expect("a contact"), ..Obstruction::nowhere(&words) };
        }
        // The vehicle can drive none of the samples: the limit that most of them exceed first.
        let (_, place) = first_of_most(counts.iter().map(|(n, _)| *n));
        Obstruction::nowhere(&counts[place].1.words(-1))
    }

    /// Where a sample is furthest off the road.
    fn obstructing_edge(&mut self, sample: usize) -> Obstruction {
        self.write(sample);
        let request = self.problem.request;
        let (overhang, at) = self.points().iter().fold((f64::NEG_INFINITY, Point::default()), |furthest, point| {
            let overhang = request.road.overhang(request.shape, point.pose(), &mut Vec::new());
            if overhang > furthest.0 { (overhang, point.center) } else { furthest }
        });
        Obstruction { rejection: Rejection::OffRoad.words(-1), at, overhang }
    }
}

/// Size and place of the largest count.
fn first_of_most(counts: impl Iterator<Item = usize>) -> (usize, usize) {
    counts.enumerate().fold((0, 0), |most, (place, count)| if count > most.0 { (count, place) } else { most })
}
