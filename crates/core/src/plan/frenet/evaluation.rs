//! Step-by-step evaluation of one sample: trajectory in the world with the limits of the vehicle, contacts, road, and
//! the expensive parts of the cost.

use std::ops::Range;

use super::super::PlanRequest;
use super::super::frame::Waypoint;
use super::cartesian::{self, FrenetTrajectory};
use super::cost::TableCosts;
use super::feasibility::{Limits, Rejection};
use super::grid::SampleGrid;
use super::obstacles::Contact;
use super::obstacles::Obstacles;
use super::search::{Entry, Refined, SearchSpace};
use super::settings::{FrenetSettings, N_TABLE_TERMS, N_TERMS, N_WORLD_TERMS};
use super::terms::{FrenetMotion, has_world_terms, weighted_world_terms, world_terms};
use crate::collision::departs_road;
use crate::geometry::Point;
use crate::geometry::shape::OrientedBox;
use crate::trajectory::Obstruction;

/// Points of the prediction term that are computed at once.
const POINTS_PER_TURN: usize = 2;
/// Sums in different orders differ by less than this fraction.
const SUMMATION_ROUNDING: f64 = 1e-12;

/// Slot of a sample that is not in the pool.
const NOWHERE: u32 = u32::MAX;

/// How far the evaluation of a sample in the pool has got.
#[derive(Debug, Clone, Copy)]
struct Progress {
    /// Cost without prediction.
    base: f64,
    /// Partial sum of the prediction term, and the number of points of the order in it.
    prediction: f64,
    n_done: usize,
    /// Its cost, once the prediction is in it.
    cost: Option<f64>,
}

/// Memory of the evaluations of one plan.
#[derive(Debug, Clone, Default)]
pub(super) struct EvaluationMemory {
    /// Place in the pool of every sample that is admissible.
    slots: Vec<u32>,
    progress: Vec<Progress>,
    /// Trajectories of the admissible samples that were examined.
    pool: Vec<Waypoint>,
    /// Their prediction terms, point by point.
    contributions: Vec<f64>,
    /// Points in the order in which their prediction terms are computed: the first trajectory's largest first, so that
    /// bounds rise early.
    order: Vec<usize>,
    points: Vec<Waypoint>,
    /// Samples that are rejected for a contact alone.
    pub(super) contacts: Vec<(u32, Contact)>,
    /// Least cost of the samples that were rejected for the road alone; inf: none was. That sample, and their number.
    pub(super) off_road_cost: f64,
    pub(super) off_road_sample: usize,
    pub(super) n_off_road: usize,
}

impl EvaluationMemory {
    fn reset(&mut self, n_samples: usize) {
        self.slots.clear();
        self.slots.resize(n_samples, NOWHERE);
        self.progress.clear();
        self.pool.clear();
        self.contributions.clear();
        self.order.clear();
        self.contacts.clear();
        self.off_road_cost = f64::INFINITY;
        self.n_off_road = 0;
    }
}

impl EvaluationMemory {
    /// Trajectories that were found to be drivable.
    pub(super) fn n_trajectories(&self) -> usize {
        self.pool.len() / self.points.len().max(1) + self.contacts.len()
    }
}

/// What is to be planned.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) request: &'a PlanRequest<'a>,
    pub(super) settings: &'a FrenetSettings,
    pub(super) limits: &'a Limits,
}

/// What has been prepared for it.
pub(super) struct Tables<'a> {
    pub(super) samples: &'a mut SampleGrid,
    pub(super) costs: &'a mut TableCosts,
    pub(super) obstacles: &'a mut Obstacles,
    pub(super) memory: &'a mut EvaluationMemory,
}

/// Everything about one plan. Samples are numbered profile by profile, end offset by end offset.
pub(super) struct Evaluation<'a> {
    pub(super) problem: Problem<'a>,
    pub(super) tables: Tables<'a>,
    /// The footprint is larger by this on all sides when the road is examined [m].
    road_margin: f64,
    prediction_weight: f64,
    world_terms: bool,
}

impl<'a> Evaluation<'a> {
    pub(super) fn new(problem: Problem<'a>, tables: Tables<'a>) -> Self {
        let Problem { request, settings, .. } = problem;
        let memory = &mut *tables.memory;
        memory.reset(tables.samples.len());
        let footprint = OrientedBox::new(request.state.pose(), request.vehicle.length, request.vehicle.width);
        let (road, vehicle, margin) = (request.road, request.vehicle, settings.road_margin);
        let has_room = request.was_on_road && road.admits_box(vehicle, &footprint.grown(margin));
        Self {
            road_margin: if has_room { margin } else { 0.0 },
            prediction_weight: settings.weights.prediction,
            world_terms: has_world_terms(&settings.weights),
            problem,
            tables,
        }
    }

    /// Number of samples.
    pub(super) fn len(&self) -> usize {
        self.tables.memory.slots.len()
    }

    /// Where the search begins: a group per profile that is not rejected.
    pub(super) fn entries(&self) -> impl Iterator<Item = Entry> {
        let n_offsets = self.tables.samples.end_offsets.len();
        let bounds = self.tables.costs.bounds.iter().enumerate();
        bounds.map(move |(profile, bound)| Entry::group(*bound, profile * n_offsets, profile))
    }

    /// Profile and end offset of a sample.
    pub(super) fn cell(&self, sample: usize) -> (usize, usize) {
        let n_offsets = self.tables.samples.end_offsets.len();
        (sample / n_offsets, sample % n_offsets)
    }

    /// The tests but the road, and the cost without prediction.
    fn admit(&mut self, sample: usize) -> Refined {
        if !self.write_if_drivable(sample) {
            return Refined::Rejected;
        }
        if let Some(contact) = self.contact() {
            self.tables.memory.contacts.push((sample as u32, contact));
            return Refined::Rejected;
        }
        let mut base = self.tables.costs.total[sample];
        if self.world_terms {
            base += weighted_world_terms(&self.problem.settings.weights, &self.world_terms(sample));
        }
        let is_complete = self.tables.obstacles.has_no_prediction_in_reach() || self.prediction_weight == 0.0;
        let memory = &mut *self.tables.memory;
        memory.slots[sample] = memory.progress.len() as u32;
        memory.pool.extend_from_slice(&memory.points);
        memory.contributions.resize(memory.pool.len(), 0.0);
        let cost = is_complete.then_some(base);
        memory.progress.push(Progress { base, prediction: 0.0, n_done: 0, cost });
        Refined::Bound(base)
    }

    /// The complete cost of the trajectory in the pool, if its footprint stays on the road.
    fn if_on_road(&mut self, sample: usize, slot: Range<usize>, cost: f64) -> Refined {
        let pool = std::mem::take(&mut self.tables.memory.pool);
        let stays = self.is_on_road(&pool[slot]);
        self.tables.memory.pool = pool;
        if stays {
            Refined::Cost(cost)
        } else {
            let memory = &mut *self.tables.memory;
            memory.n_off_road += 1;
            if cost < memory.off_road_cost {
                (memory.off_road_cost, memory.off_road_sample) = (cost, sample);
            }
            Refined::Rejected
        }
    }

    /// The trajectory that was written last.
    pub(super) fn points(&self) -> &[Waypoint] {
        &self.tables.memory.points
    }

    /// Writes the trajectory of a sample, if the vehicle can drive it.
    pub(super) fn write_if_drivable(&mut self, sample: usize) -> bool {
        let (profile, end_offset) = self.cell(sample);
        if self.tables.samples.profiles[profile].rejection != Rejection::Admissible {
            return false;
        }
        self.load(profile);
        let sample = in_path_frame(self.tables.samples, profile, end_offset);
        let center = self.problem.request.vehicle.rear_axle_to_center;
        cartesian::write(&sample, self.problem.limits, center, &mut self.tables.memory.points)
    }

    /// Everything about a profile that its samples share.
    fn load(&mut self, profile: usize) {
        self.tables.samples.lateral_table(profile);
        self.tables.samples.load_path(profile, &self.problem.request.route.path);
    }

    /// Writes the trajectory of a sample and returns its fault. Points that are undefined (near the centre of the
    /// path's curvature) repeat the one before.
    pub(super) fn write_points(&mut self, sample: usize) -> Rejection {
        self.tables.memory.points.clear();
        let (profile, end_offset) = self.cell(sample);
        self.load(profile);
        let mut found = self.tables.samples.profiles[profile].rejection;
        let center = self.problem.request.vehicle.rear_axle_to_center;
        let sample = in_path_frame(self.tables.samples, profile, end_offset);
        for i in 0..self.problem.limits.n_points {
            let before = self.tables.memory.points.last().copied();
            let (at, frenet) = sample.at(i);
            let point = Waypoint::new(&at, &frenet, center);
            match (point, before) {
                (None, _) => found = found.or(Rejection::LeftPath),
                (Some(point), Some(before)) => found = found.or(self.problem.limits.check(&before, &point, i)),
                (Some(_), None) => {}
            }
            self.tables.memory.points.push(point.or(before).unwrap_or_default());
        }
        found
    }

    /// First contact of the trajectory that was written last.
    pub(super) fn contact(&mut self) -> Option<Contact> {
        self.tables.obstacles.first_contact(&self.tables.memory.points, self.problem.limits.dt, self.problem.request)
    }

    /// The footprint (with margin) stays on the road, at the points and between them; an agent that starts (partly)
    /// beside it must do so once it is back. Without margin the first step, which will be driven, is examined as
    /// closely as the world does.
    fn is_on_road(&mut self, points: &[Waypoint]) -> bool {
        let PlanRequest { road, shape, state, vehicle, mut was_on_road, .. } = *self.problem.request;
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

    /// The trajectory that was written last stays on the road.
    pub(super) fn stays_on_road(&mut self) -> bool {
        let points = std::mem::take(&mut self.tables.memory.points);
        let stays = self.is_on_road(&points);
        self.tables.memory.points = points;
        stays
    }

    /// Terms of the cost that need the trajectory that was written last.
    pub(super) fn world_terms(&self, sample: usize) -> [f64; N_WORLD_TERMS] {
        let (profile, end_offset) = self.cell(sample);
        let samples = &*self.tables.samples;
        let motion = |i: usize| {
            let d = samples.lateral_points(profile).at(i, samples.end_offsets[end_offset]);
            FrenetMotion::new(&samples.motions(profile).at(i), d, samples.profiles[profile].is_over_arc)
        };
        let (points, request) = (&self.tables.memory.points, self.problem.request);
        world_terms(points, motion, self.tables.obstacles.distance_cost(points, request), request.dt)
    }

    /// All terms of the cost of the sample that was written last.
    pub(super) fn terms(&self, sample: usize) -> [f64; N_TERMS] {
        let mut terms = [0.0; N_TERMS];
        terms[..N_TABLE_TERMS].copy_from_slice(&self.table_terms(sample));
        terms[N_TABLE_TERMS..N_TERMS - 1].copy_from_slice(&self.world_terms(sample));
        let (obstacles, request) = (&*self.tables.obstacles, self.problem.request);
        let points = self.points().iter().enumerate().skip(1);
        terms[N_TERMS - 1] = points.map(|(i, point)| obstacles.prediction_cost(point, i, request)).sum();
        terms
    }

    /// The terms of a sample that need only its profile and its end offset.
    pub(super) fn table_terms(&self, sample: usize) -> [f64; N_TABLE_TERMS] {
        let (profile, end_offset) = self.cell(sample);
        let (samples, profile) = (&*self.tables.samples, &self.tables.samples.profiles[profile]);
        let k = profile.table.expect("the lateral motion is there") * samples.end_offsets.len() + end_offset;
        [self.tables.costs.velocity_offset[sample], samples.lateral.offset[k], samples.lateral.jerk[k], profile.jerk]
    }
}

/// A sample in the frame of the path, whose profile is loaded.
fn in_path_frame(samples: &SampleGrid, profile: usize, end_offset: usize) -> FrenetTrajectory<'_> {
    FrenetTrajectory {
        motion: samples.motions(profile),
        path: samples.path(profile),
        lateral: samples.lateral_points(profile),
        end_offset: samples.end_offsets[end_offset],
        is_over_arc: samples.profiles[profile].is_over_arc,
    }
}

impl Evaluation<'_> {
    /// Why no sample is admissible, after a search that rejected every sample: what rejected most of the samples that the
    /// vehicle can drive. Contacts with one participant count together; the first of equals counts.
    pub(super) fn obstruction(&mut self) -> Obstruction {
        let memory = &*self.tables.memory;
        let mut hits = vec![0_usize; self.problem.request.others.len()];
        memory.contacts.iter().for_each(|(_, contact)| hits[contact.other] += 1);
        let (other, most) = first_of_most(&hits);
        if memory.n_off_road > most {
            self.obstructing_edge()
        } else if most > 0 {
            self.obstructing_contact(other)
        } else {
            self.obstructing_limit()
        }
    }

    /// The samples hit a participant: where the first of them does.
    fn obstructing_contact(&mut self, other: usize) -> Obstruction {
        let contacts = self.tables.memory.contacts.iter().filter(|(_, contact)| contact.other == other);
        let (sample, contact) = *contacts.min_by_key(|(sample, _)| *sample).expect("there is a contact");
        self.write_if_drivable(sample as usize);
        let request = self.problem.request;
        let words = Rejection::Collision.words(request.predictions.ids[request.others[other].row]);
        Obstruction { at: self.points()[contact.interval + 1].center, ..Obstruction::nowhere(&words) }
    }

    /// The samples leave the road: where the cheapest of them is furthest outside.
    fn obstructing_edge(&mut self) -> Obstruction {
        self.write_if_drivable(self.tables.memory.off_road_sample);
        let request = self.problem.request;
        let (overhang, at) = self.points().iter().fold((f64::NEG_INFINITY, Point::default()), |furthest, point| {
            let overhang = request.road.overhang(request.shape, point.pose(), &mut Vec::new());
            if overhang > furthest.0 { (overhang, point.center) } else { furthest }
        });
        Obstruction { rejection: Rejection::OffRoad.words(-1), at, overhang }
    }

    /// The vehicle can drive none of the samples: which limit they exceed first.
    fn obstructing_limit(&mut self) -> Obstruction {
        let mut counts = [0; Rejection::ALL.len()];
        for sample in 0..self.len() {
            counts[self.write_points(sample) as usize] += 1;
        }
        counts[Rejection::Admissible as usize] = 0;
        Obstruction::nowhere(&Rejection::ALL[first_of_most(&counts).0].words(-1))
    }
}

/// Place and size of the largest count.
fn first_of_most(counts: &[usize]) -> (usize, usize) {
    let largest = counts.iter().copied().enumerate().rev().max_by_key(|(_, count)| *count);
    largest.unwrap_or((0, 0))
}

impl SearchSpace for Evaluation<'_> {
    fn open(&mut self, profile: usize) -> impl Iterator<Item = f64> {
        let (samples, path) = (&mut *self.tables.samples, &self.problem.request.route.path);
        self.tables.costs.compute_profile(samples, profile, &self.problem.settings.weights, path);
        let n_offsets = samples.end_offsets.len();
        self.tables.costs.total[profile * n_offsets..(profile + 1) * n_offsets].iter().copied()
    }

    /// One more step of work on a sample: first feasibility and contacts, then its prediction term, some points per
    /// turn, at last the road, which few get to.
    fn refine(&mut self, sample: usize) -> Refined {
        let n_points = self.problem.limits.n_points;
        let EvaluationMemory { slots, progress, pool, contributions, order, .. } = &mut *self.tables.memory;
        let slot = slots[sample];
        if slot == NOWHERE {
            return self.admit(sample);
        }
        let progress = &mut progress[slot as usize];
        let slot = slot as usize * n_points..(slot as usize + 1) * n_points;
        if let Some(cost) = progress.cost {
            return self.if_on_road(sample, slot, cost);
        }
        let (points, contributions) = (&pool[slot.clone()], &mut contributions[slot]);
        let (obstacles, request) = (&*self.tables.obstacles, self.problem.request);
        let is_first = order.is_empty();
        if is_first {
            order.extend(1..n_points);
        }
        let before = progress.prediction;
        while progress.n_done < order.len() && (is_first || progress.prediction == before) {
            let end = (progress.n_done + POINTS_PER_TURN).min(order.len());
            for point in &order[progress.n_done..end] {
                contributions[*point] = obstacles.prediction_cost(&points[*point], *point, request);
                progress.prediction += contributions[*point];
            }
            progress.n_done = end;
        }
        if is_first {
            order.sort_unstable_by(|a, b| contributions[*b].total_cmp(&contributions[*a]).then(a.cmp(b)));
        }
        if progress.n_done < order.len() {
            let bound = progress.base + self.prediction_weight * progress.prediction;
            return Refined::Bound(bound * (1.0 - SUMMATION_ROUNDING));
        }
        // Summed in the order of time, so the result does not depend on the order of the work.
        let prediction: f64 = contributions[1..].iter().sum();
        let cost = progress.base + self.prediction_weight * prediction;
        progress.cost = Some(cost);
        Refined::Bound(cost)
    }
}
