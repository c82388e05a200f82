//! Worlds on rails: vehicles that see nothing but the leader in their lane and their orders. An area that two use at once
//! is a fault of the arbitration, and so is a vehicle that never gets through.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use super::{Body, Course, Memory, Order, Place, Traffic, Traveller, Zone};
use crate::control::Control;
use crate::geometry::Point;
use crate::geometry::polyline::ReferencePath;
use crate::geometry::shape::Lcg;
use crate::junctions::{AreaKind, Junctions};
use crate::road::RoadNetwork;
use crate::road::testing::{lane, open, with_successors};
use crate::route::{PathPiece, Route};
use crate::rules::{RulesSettings, SpeedLimits};
use crate::vehicle::ParticipantKind;

const DT: f64 = 0.1;
/// Distance of junctions, half their size, lanes beside the middle of the road [m].
const BLOCK: f64 = 34.0;
const HALF: f64 = 7.0;
const OFFSET: f64 = 1.75;
const LINK: f64 = BLOCK - 2.0 * HALF;
const LIMIT: f64 = 10.0;
/// Areas are shared if both vehicles are in by more than this [m].
const SHARED: f64 = 0.3;

/// Junctions in a grid, one lane per direction between them. A link is named by the junction to which it leads and its
/// direction (0 east, 1 north, ...), a connector by its junction and both directions.
struct Grid {
    road: RoadNetwork,
    junctions: Junctions,
    size: i64,
}

fn link(node: (i64, i64), d: usize) -> i64 {
    ((node.0 + 1) * 10 + node.1 + 1) * 100 + d as i64
}

fn connector(node: (i64, i64), d: usize, e: usize) -> i64 {
    link(node, d) + 10 * (e as i64 + 1)
}

fn next(node: (i64, i64), d: usize) -> (i64, i64) {
    let (x, y) = [(1, 0), (0, 1), (-1, 0), (0, -1)][d];
    (node.0 + x, node.1 + y)
}

/// Directions after going straight on, left and right.
fn ways(d: usize) -> [usize; 3] {
    [d, (d + 1) % 4, (d + 3) % 4]
}

impl Grid {
    fn new(size: i64) -> Self {
        let mut lanelets = Vec::new();
        for (x, y) in (0..size).flat_map(|x| (0..size).map(move |y| (x, y))) {
            for d in 0..4 {
                let place = |d: usize, along: f64| {
                    let axis = Point::from_angle(d as f64 * FRAC_PI_2);
                    Point::new(x as f64 * BLOCK, y as f64 * BLOCK) + axis * along - axis.left() * OFFSET
                };
                let start = place(d, -HALF);
                let away =
                    |n: f64| (0..=20).map(|i| place(d, -HALF - LINK + n * f64::from(i) / 20.0)).collect::<Vec<_>>();
                let connectors: Vec<i64> = ways(d).iter().map(|e| connector((x, y), d, *e)).collect();
                lanelets.push(with_successors(lane(link((x, y), d), &away(LINK)), &connectors));
                for e in ways(d) {
                    let end = place(e, HALF);
                    let reach = start.distance(end) * if e == d { 1.0 / 3.0 } else { 0.55 };
                    let (from, to) = (Point::from_angle(d as f64 * FRAC_PI_2), Point::from_angle(e as f64 * FRAC_PI_2));
                    let control = [start, start + from * reach, end - to * reach, end];
                    let at = |t: f64| {
                        let u = 1.0 - t;
                        control[0] * (u * u * u)
                            + control[1] * (3.0 * u * u * t)
                            + control[2] * (3.0 * u * t * t)
                            + control[3] * (t * t * t)
                    };
                    let points: Vec<Point> = (0..=20).map(|i| at(f64::from(i) / 20.0)).collect();
                    lanelets.push(with_successors(lane(connector((x, y), d, e), &points), &[link(next((x, y), e), e)]));
                }
                let beyond = next((x, y), d);
                if !(0..size).contains(&beyond.0) || !(0..size).contains(&beyond.1) {
                    let points: Vec<Point> = (0..=20).map(|i| place(d, HALF + LINK * f64::from(i) / 20.0)).collect();
                    lanelets.push(lane(link(beyond, d), &points));
                }
            }
        }
        let road = open(lanelets);
        let junctions = Junctions::of(&road, &Control::default());
        Self { road, junctions, size }
    }

    fn route(&self, ids: &[i64]) -> Route {
        let lanelets: Vec<usize> = ids.iter().map(|id| self.road.index_of(*id).expect("a lanelet")).collect();
        let center = |index: &usize| self.road.lanelets()[*index].center.points().to_vec();
        let points: Vec<Point> = lanelets.iter().flat_map(center).collect();
        let path = ReferencePath::through(&points).expect("a path");
        Route {
            pieces: PathPiece::chain(&path, &lanelets, &self.road),
            lanelets,
            path,
            start_s: 0.0,
            goal_entry_s: f64::NAN,
            goal_exit_s: f64::NAN,
            lane_changes: 0,
            user: ParticipantKind::Car,
        }
    }
}

struct Vehicle {
    id: i64,
    length: f64,
    route: usize,
    front: f64,
    velocity: f64,
    memory: Memory,
    is_done: bool,
}

struct World<'a> {
    grid: &'a Grid,
    /// Ids of the lanelets and length of the vehicles -> path length and course.
    routes: &'a mut Vec<(f64, Course)>,
    known: &'a mut BTreeMap<(Vec<i64>, i64), usize>,
    vehicles: Vec<Vehicle>,
    settings: RulesSettings,
    time_step: i64,
    overlaps: usize,
    longest: usize,
    exceptions: usize,
}

impl<'a> World<'a> {
    fn new(
        grid: &'a Grid,
        routes: &'a mut Vec<(f64, Course)>,
        known: &'a mut BTreeMap<(Vec<i64>, i64), usize>,
    ) -> Self {
        let settings = RulesSettings::default();
        Self { grid, routes, known, vehicles: vec![], settings, time_step: 0, overlaps: 0, longest: 0, exceptions: 0 }
    }

    fn add(&mut self, ids: Vec<i64>, length: f64, front: f64, velocity: f64) {
        let key = (ids, length as i64);
        let route = *self.known.entry(key).or_insert_with_key(|(ids, _)| {
            let route = self.grid.route(ids);
            let limits = SpeedLimits::uniform(LIMIT);
            let map = (&self.grid.road, &self.grid.junctions);
            let car = crate::vehicle::Vehicle::BMW_320I;
            let vehicle = crate::vehicle::Vehicle { length, width: 1.8, ..car };
            self.routes.push((route.path.length(), Course::along(&route, map, &limits, &vehicle)));
            self.routes.len() - 1
        });
        let id = self.vehicles.len() as i64 + 1;
        self.vehicles.push(Vehicle { id, length, route, front, velocity, memory: Memory::default(), is_done: false });
    }

    fn orders(&self) -> (Vec<Body>, Vec<Order>) {
        let course = |vehicle: &Vehicle| &self.routes[vehicle.route].1;
        let driving: Vec<&Vehicle> = self.vehicles.iter().filter(|vehicle| !vehicle.is_done).collect();
        let bodies: Vec<Body> = driving
            .iter()
            .map(|vehicle| {
                let at = |to_front: f64| {
                    let (lanelet, s) = course(vehicle).lanelet_at(vehicle.front - to_front)?;
                    Some(Place { lanelet, s, to_front })
                };
                let places = [at(0.0), at(vehicle.length)].into_iter().flatten().collect();
                Body { id: vehicle.id, length: vehicle.length, velocity: vehicle.velocity, places }
            })
            .collect();
        let traveller = |(body, vehicle): (usize, &&'_ Vehicle)| Traveller {
            body,
            width: 1.8,
            front: vehicle.front,
            course: &self.routes[vehicle.route].1,
            settings: &self.settings,
            memory: vehicle.memory,
            line: f64::INFINITY,
            crosswalk: f64::INFINITY,
            asks_by_message: false,
            turns_on_red: false,
            unseen: &[],
            sight: f64::INFINITY,
        };
        let travellers: Vec<Traveller<'_>> = driving.iter().enumerate().map(traveller).collect();
        let traffic =
            Traffic { time_step: self.time_step, dt: DT, bodies: &bodies, travellers: &travellers, visits: &[] };
        let orders = traffic.orders(&|_, _| true);
        (bodies, orders)
    }

    fn step(&mut self) {
        let (bodies, orders) = self.orders();
        self.exceptions += orders.iter().filter(|order| order.memory.exception == Some(self.time_step)).count();
        let speeds: Vec<f64> = (0..self.vehicles.len()).map(|i| self.speed(i, &bodies, &orders)).collect();
        for (vehicle, speed) in self.vehicles.iter_mut().zip(speeds).filter(|(vehicle, _)| !vehicle.is_done) {
            vehicle.front += 0.5 * (vehicle.velocity + speed) * DT;
            vehicle.velocity = speed;
            let kept = orders.iter().find(|order| order.id == vehicle.id).map(|order| order.memory);
            let standing = if speed < 0.1 { vehicle.memory.standing + 1 } else { 0 };
            vehicle.memory = Memory { standing, ..kept.unwrap_or_default() };
            self.longest = self.longest.max(standing);
            vehicle.is_done = vehicle.front >= self.routes[vehicle.route].0 - 1.0;
        }
        self.time_step += 1;
        self.judge();
    }

    /// Speed at the next step [m/s].
    fn speed(&self, index: usize, bodies: &[Body], orders: &[Order]) -> f64 {
        let vehicle = &self.vehicles[index];
        let course = &self.routes[vehicle.route].1;
        let mut target = (vehicle.velocity + 2.0 * DT).min(LIMIT);
        for passage in course.passages.iter().filter(|passage| vehicle.front < passage.end) {
            let ahead = (passage.entry_line - vehicle.front).max(0.0);
            target = target.min((passage.speed.powi(2) + 6.0 * ahead).sqrt());
        }
        for body in bodies.iter().filter(|body| body.id != vehicle.id) {
            let place =
                |place: &Place| Some(course.place(place.lanelet, place.s, vehicle.front - 30.0)? + place.to_front);
            let Some(front) = body.places.iter().find_map(place) else { continue };
            if (front, body.id) > (vehicle.front, vehicle.id) {
                let gap = front - body.length - vehicle.front;
                let square = 1.6 * 1.6 + body.velocity.powi(2) + 8.0 * (gap - 1.0);
                target = target.min((square.max(0.0).sqrt() - 1.6).max(0.0));
            }
        }
        for other in self.vehicles.iter().filter(|other| !other.is_done && other.id != vehicle.id) {
            if let Some(gap) = self.gap_on_merge(vehicle, other) {
                let square = 1.6 * 1.6 + other.velocity.powi(2) + 8.0 * (gap - 1.0);
                target = target.min((square.max(0.0).sqrt() - 1.6).max(0.0));
            }
        }
        if let Some(barrier) = orders.iter().find(|order| order.id == vehicle.id).and_then(|order| order.barrier) {
            let room = barrier.s - vehicle.front;
            if barrier.until.is_infinite() || vehicle.velocity.max(target) * barrier.until > room {
                target = target.min((6.0 * (room - 0.5).max(0.0)).sqrt());
            }
        }
        target.max(vehicle.velocity - 8.0 * DT).max(0.0)
    }

    /// Distance to one that is nearer to the end of a merge and in it [m].
    fn gap_on_merge(&self, vehicle: &Vehicle, other: &Vehicle) -> Option<f64> {
        let zones = |vehicle: &Vehicle| self.routes[vehicle.route].1.zones();
        let is_merge = |zone: &&Zone| zone.kind == AreaKind::Merge && vehicle.front < zone.exit;
        zones(vehicle).filter(is_merge).find_map(|own| {
            let theirs = zones(other).find(|theirs| theirs.area == own.area && theirs.side != own.side)?;
            let (left, their_left) = (own.exit - vehicle.front, theirs.exit - other.front);
            let is_ahead = other.front > theirs.entry && (their_left, other.id) < (left, vehicle.id);
            (is_ahead && left < 40.0).then_some(left - their_left - other.length)
        })
    }

    /// Counts pairs that use an area at once.
    fn judge(&mut self) {
        for (i, a) in self.vehicles.iter().enumerate().filter(|(_, vehicle)| !vehicle.is_done) {
            for b in self.vehicles[i + 1..].iter().filter(|vehicle| !vehicle.is_done) {
                let inside = |vehicle: &Vehicle| {
                    let (front, rear) = (vehicle.front, vehicle.front - vehicle.length);
                    let is_in = move |zone: &&Zone| front > zone.entry + SHARED && rear < zone.exit - SHARED;
                    self.routes[vehicle.route].1.zones().filter(is_in).copied().collect::<Vec<_>>()
                };
                let (here, there) = (inside(a), inside(b));
                self.overlaps += here
                    .iter()
                    .flat_map(|one| there.iter().map(move |other| (one, other)))
                    .filter(|(one, other)| one.area == other.area && one.side != other.side)
                    // On a merge they may follow each other.
                    .filter(|(one, other)| {
                        let (left, right) = (one.exit - a.front, other.exit - b.front);
                        let follows = left + 0.05 >= right + b.length || right + 0.05 >= left + a.length;
                        one.kind != AreaKind::Merge || !follows
                    })
                    .count();
            }
        }
    }

    fn is_stuck(&self) -> bool {
        self.vehicles.iter().filter(|vehicle| !vehicle.is_done).all(|vehicle| vehicle.memory.standing > 600)
    }

    fn run(&mut self) {
        while self.time_step < 6000 && !self.vehicles.iter().all(|vehicle| vehicle.is_done) && !self.is_stuck() {
            self.step();
        }
    }

    fn n_left(&self) -> usize {
        self.vehicles.iter().filter(|vehicle| !vehicle.is_done).count()
    }
}

/// Drives that begin on a link and cross some junctions, until the road ends.
fn drive(grid: &Grid, random: &mut Lcg, mut node: (i64, i64), mut d: usize, hops: usize) -> Vec<i64> {
    let mut ids = vec![link(node, d)];
    for _ in 0..hops {
        let on: Vec<usize> = ways(d)
            .into_iter()
            .filter(|e| {
                grid.size == 1 || [next(node, *e).0, next(node, *e).1].iter().all(|c| (0..grid.size).contains(c))
            })
            .collect();
        let e = on[(random.within(0.0, on.len() as f64) as usize).min(on.len() - 1)];
        ids.push(connector(node, d, e));
        (node, d) = (next(node, e), e);
        ids.push(link(node, d));
        if grid.size == 1 {
            break;
        }
    }
    ids
}

fn random_worlds(size: i64, n: u64, per_lane: usize, hops: usize) -> (usize, usize, usize, f64, usize) {
    let grid = Grid::new(size);
    let (mut routes, mut known) = (Vec::new(), BTreeMap::new());
    let (mut stuck, mut overlapping, mut total, mut longest, mut exceptions) = (0, 0, 0, 0, 0);
    for seed in 0..n {
        let random = &mut Lcg::new(seed + 1);
        let mut world = World::new(&grid, &mut routes, &mut known);
        for node in (0..size).flat_map(|x| (0..size).map(move |y| (x, y))) {
            for d in 0..4 {
                let mut rear = LINK;
                for place in 0..per_lane {
                    let length = if random.within(0.0, 7.0) < 6.0 { 5.0 } else { 9.0 };
                    let front = (rear - 1.0).min(LINK - 1.0 - place as f64 * LINK / per_lane as f64);
                    if random.within(0.0, 1.0) < 0.85 && front - length > 0.2 {
                        let velocity = if place == 0 && random.within(0.0, 3.0) < 1.0 { 2.0 } else { 0.0 };
                        let hops = 2 + (random.within(0.0, hops as f64 - 1.0) as usize).min(hops - 2);
                        let ids = drive(&grid, random, node, d, hops);
                        world.add(ids, length, front, velocity);
                        rear = front - length;
                    }
                }
            }
        }
        world.run();
        total += world.vehicles.len();
        stuck += usize::from(world.n_left() > 0);
        overlapping += usize::from(world.overlaps > 0);
        longest = longest.max(world.longest);
        exceptions += world.exceptions;
    }
    (stuck, overlapping, total, longest as f64 * DT, exceptions)
}

#[test]
fn vehicles_get_through_single_junctions_and_never_share_an_area() {
    let (stuck, overlapping, total, longest, _) = random_worlds(1, 1000, 3, 2);
    assert_eq!((stuck, overlapping, total), (0, 0, 9059), "longest stand {longest} s");
    assert!(longest < 40.0, "{longest}");
}

/// In four of the grids one vehicle merges up to half a metre too close behind another one: they may follow each other there,
/// and one that cannot stop any more is not told to come later.
#[test]
fn jammed_grids_dissolve() {
    let (stuck, overlapping, total, longest, exceptions) = random_worlds(2, 60, 3, 6);
    assert_eq!((stuck, total), (0, 2207), "longest stand {longest} s, {exceptions} exceptions");
    assert!(overlapping <= 4, "{overlapping}");
    assert!(exceptions > 0, "no grid was jammed");
}

/// What became of a ring of four junctions; on each of its links three vehicles stand, which turn left three times.
#[derive(Debug)]
struct Ring {
    n_left: usize,
    n_overlaps: usize,
    /// The largest distance of a front beyond the first entry line on its way [m], as long as all are there.
    beyond: f64,
    /// The first agent that gets an exception, and when [s].
    first_exception: Option<(i64, f64)>,
    time: f64,
}

fn ring(circle_after: f64) -> Ring {
    let grid = Grid::new(2);
    let (mut routes, mut known) = (Vec::new(), BTreeMap::new());
    let mut world = World::new(&grid, &mut routes, &mut known);
    world.settings.circle_after = circle_after;
    for (d, node) in [(1, 0), (1, 1), (0, 1), (0, 0)].into_iter().enumerate() {
        let (mut ids, mut at) = (vec![link(node, d)], node);
        for e in (d..d + 3).map(|e| e % 4) {
            let left = (e + 1) % 4;
            ids.push(connector(at, e, left));
            at = next(at, left);
            ids.push(link(at, left));
        }
        for place in 0..3 {
            world.add(ids.clone(), 5.0, 0.0, 0.0);
            let vehicle = world.vehicles.last_mut().expect("it was added");
            vehicle.front = world.routes[vehicle.route].1.passages[0].entry_line - 0.5 - 6.0 * f64::from(place);
        }
    }
    let (mut beyond, mut first_exception) = (f64::NEG_INFINITY, None);
    while world.time_step < 6000 && world.n_left() > 0 && !world.is_stuck() {
        world.step();
        for vehicle in &world.vehicles {
            if world.n_left() == world.vehicles.len() {
                beyond = beyond.max(vehicle.front - world.routes[vehicle.route].1.passages[0].entry_line);
            }
            let exception = vehicle.memory.exception.map(|since| (vehicle.id, since as f64 * DT));
            first_exception = first_exception.or(exception);
        }
    }
    let time = world.time_step as f64 * DT;
    Ring { n_left: world.n_left(), n_overlaps: world.overlaps, beyond, first_exception, time }
}

#[test]
fn without_exceptions_no_agent_passes_an_entry_line_in_a_full_ring_of_left_turns() {
    let found = ring(f64::INFINITY);
    assert_eq!((found.n_left, found.first_exception), (12, None), "{found:?}");
    assert!(found.beyond < -0.4 && found.time > 60.0, "{found:?}");
}

#[test]
fn in_a_full_ring_of_left_turns_the_least_id_has_the_first_exception_and_all_leave() {
    let found = ring(RulesSettings::default().circle_after);
    assert_eq!((found.n_left, found.n_overlaps), (0, 0), "{found:?}");
    assert_eq!(found.first_exception, Some((1, 5.0)), "{found:?}");
    assert!(found.time < 35.0, "{found:?}");
}
