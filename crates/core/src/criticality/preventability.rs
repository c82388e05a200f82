//! Whether a reference driver in the agent's place would have avoided a contact: from the stored states alone, nothing is
//! simulated anew. Definitions: docs/concepts/preventability.md.

use std::f64::consts::PI;

use super::blame::{ALONGSIDE_ANGLE, ONCOMING_ANGLE, Pair, Track, side};
use super::footing::is_within_one_lane;
use super::traffic::Traffic;
use crate::collision::{first_contact, pose_between};
use crate::conduct::REST_SPEED;
use crate::error::Result;
use crate::geometry::{Point, Pose, wrap_angle};
use crate::reference_drivers::{Driver, Reaction, Seen};

/// Drivers are followed for this long after the contact [s].
const AFTERWARDS: f64 = 3.0;
/// Longest step of a driver [s].
const STEP_MAX: f64 = 0.1;
/// An agent that came near another one without a contact would have gone on for so long [s].
const ONWARDS: f64 = 1.0;
/// The way to a contact goes on for this much beyond it [m]: footprints touch there, so that rounding would decide whether
/// what stands is in the way.
const TOUCHING: f64 = 0.001;

/// What is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conflict {
    /// The agent.
    pub agent: i64,
    /// Its partner.
    pub partner: i64,
    /// Time step of the first states after the contact, or at which they were near.
    pub time_step: i64,
    /// They touched.
    pub is_contact: bool,
    /// The partner is a pedestrian.
    pub is_pedestrian: bool,
}

/// Why there is no verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Undefined {
    /// There is one.
    Not,
    /// The agent stood.
    Stood,
    /// It reversed.
    Reversed,
    /// Their ways crossed.
    Crossing,
    /// They came towards each other.
    Oncoming,
    /// The partner is a pedestrian.
    Pedestrian,
    /// It was hit from behind.
    Behind,
}

impl Undefined {
    /// Names used outside.
    pub fn name(self) -> &'static str {
        match self {
            Self::Not => "",
            Self::Stood => "stood",
            Self::Reversed => "reversed",
            Self::Crossing => "crossing",
            Self::Oncoming => "oncoming",
            Self::Pedestrian => "pedestrian",
            Self::Behind => "behind",
        }
    }
}

/// How the partner came to be in the agent's way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entry {
    /// It was in it at the first step at which both are there.
    Ahead,
    /// It left its lane, the agent did not.
    Partner,
    /// The agent left its lane, the partner did not.
    Agent,
    /// Both or neither.
    Both,
}

impl Entry {
    /// Names used outside.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ahead => "ahead",
            Self::Partner => "partner",
            Self::Agent => "agent",
            Self::Both => "both",
        }
    }

    /// The partner is in the way from the step `from` on.
    fn of(pair: &Pair<'_>, from: usize) -> Self {
        if from == 0 {
            return Self::Ahead;
        }
        let road = pair.road();
        // A vehicle that is over a border all along, as wide ones and recorded ones in narrow lanes are, leaves nothing.
        let leaves = |track: &Track<'_>| {
            let is_within = |pose: &Pose| is_within_one_lane(road, track.shape, *pose);
            let over = track.poses[from..].iter().rposition(|pose| !is_within(pose));
            over.is_some_and(|over| track.poses[..from + over].iter().rev().any(is_within))
        };
        match (leaves(&pair.agent), leaves(&pair.other)) {
            (true, false) => Self::Agent,
            (false, true) => Self::Partner,
            _ => Self::Both,
        }
    }
}

/// A driver in the agent's place.
#[derive(Debug, Clone, PartialEq)]
pub struct Replacement {
    /// It does not touch the partner.
    pub avoids: bool,
    /// Difference of the velocities at the contact [m/s]; NaN without one.
    pub impact_speed: f64,
    /// Least distance of the footprints [m]; 0 with a contact.
    pub distance: f64,
    /// Its speeds, from when it takes over, every `step` seconds [m/s].
    pub velocity: Vec<f64>,
    /// Its poses then; the witness.
    pub poses: Vec<Pose>,
}

/// The verdict on one conflict.
#[derive(Debug, Clone, PartialEq)]
pub struct Preventability {
    /// Why there is none.
    pub undefined: Undefined,
    /// How the partner came into the way.
    pub entry: Entry,
    /// Time step at which drivers take over, before the contact.
    pub from: i64,
    /// Speed of the agent then [m/s].
    pub velocity: f64,
    /// Time from then to the contact [s].
    pub time: f64,
    /// Step of the replacements [s].
    pub step: f64,
    /// By driver, in the order of `Driver::ALL`; empty without a verdict.
    pub replacements: Vec<Replacement>,
}

/// Verdicts on conflicts, in the order given.
///
/// # Errors
/// `InvalidInput` or `UnknownId` naming the conflict that cannot be judged.
pub fn preventability(traffic: &Traffic, conflicts: &[Conflict]) -> Result<Vec<Preventability>> {
    conflicts.iter().map(|conflict| judged(traffic, conflict)).collect()
}

fn judged(traffic: &Traffic, conflict: &Conflict) -> Result<Preventability> {
    let pair = Pair::new(traffic, (conflict.agent, conflict.partner, conflict.time_step))?;
    let way = Way::of(&pair.agent, conflict.is_contact);
    let from = way.entered_at(&pair);
    let n_sub = (traffic.dt / STEP_MAX - 1e-9).ceil().max(1.0);
    let mut found = Preventability {
        undefined: undefined(&pair, conflict, from),
        entry: Entry::of(&pair, from),
        from: pair.first + from as i64,
        velocity: pair.agent.speeds[from],
        time: (pair.instant - (pair.first + from as i64) as f64) * traffic.dt,
        step: traffic.dt / n_sub,
        replacements: Vec::new(),
    };
    if found.undefined == Undefined::Not {
        let other = OtherTrack::new(traffic, conflict.partner, found.from);
        let replace = |driver| replacement(&pair, &way, &other, (driver, from), &found);
        found.replacements = Driver::ALL.map(replace).into();
    }
    Ok(found)
}

fn undefined(pair: &Pair<'_>, conflict: &Conflict, from: usize) -> Undefined {
    let (agent, other) = (&pair.agent, &pair.other);
    let headings = wrap_angle(other.contact().orientation - agent.contact().orientation).abs();
    // Between the directions in which both move.
    let angle = if other.speed() < 0.0 { PI - headings } else { headings };
    let drives = other.speed().abs() > REST_SPEED;
    if conflict.is_pedestrian {
        Undefined::Pedestrian
    } else if agent.speed() < -REST_SPEED || agent.speeds[from] < -REST_SPEED {
        Undefined::Reversed
    } else if agent.speed() <= REST_SPEED {
        Undefined::Stood
    } else if drives && angle > ONCOMING_ANGLE {
        Undefined::Oncoming
    } else if drives && angle > ALONGSIDE_ANGLE {
        Undefined::Crossing
    } else if side(agent, other) == 3 {
        Undefined::Behind
    } else {
        Undefined::Not
    }
}

/// The agent's own track, straight on beyond its end.
struct Way {
    poses: Vec<Pose>,
    /// Way driven up to each pose [m].
    driven: Vec<f64>,
}

impl Way {
    fn of(agent: &Track<'_>, is_contact: bool) -> Self {
        let mut poses = agent.poses.clone();
        let end = agent.contact();
        let onwards = if is_contact { TOUCHING } else { agent.speed().max(0.0) * ONWARDS };
        poses.push(Pose { position: end.position + Point::from_angle(end.orientation) * onwards, ..end });
        let mut driven = vec![0.0];
        for pair in poses.windows(2) {
            driven.push(driven[driven.len() - 1] + pair[0].position.distance(pair[1].position));
        }
        Self { poses, driven }
    }

    /// First step of the unbroken stretch up to the contact in which the other is in the way; if there is none, the last
    /// one before the contact.
    fn entered_at(&self, pair: &Pair<'_>) -> usize {
        let (agent, other) = (&pair.agent, &pair.other);
        let contact = agent.poses.len() - 1;
        // Without the margin of blame: a driver that reacts to what touches its way must not be judged by what is near it.
        let reach = agent.shape.bounding_radius() + other.shape.bounding_radius();
        let meets = |step: &usize| {
            self.poses[*step..].windows(2).any(|poses| {
                // Between two poses the agent moves by little more than its length.
                let near = poses[0].position.distance(poses[1].position) + reach;
                other.poses[*step].position.distance(poses[0].position) <= near
                    && first_contact(
                        agent.shape,
                        poses[0],
                        poses[1],
                        other.shape,
                        other.poses[*step],
                        other.poses[*step],
                    )
                    .is_some()
            })
        };
        (0..contact).rev().take_while(meets).last().unwrap_or(contact - 1)
    }

    /// Pose after a way from a step on [m].
    fn at(&self, from: usize, way: f64) -> Pose {
        let s = self.driven[from] + way;
        let last = self.poses.len() - 1;
        if s >= self.driven[last] {
            let end = self.poses[last];
            let over = Point::from_angle(end.orientation) * (s - self.driven[last]);
            return Pose { position: end.position + over, ..end };
        }
        let next = self.driven.partition_point(|driven| *driven <= s).clamp(1, last);
        let (before, after) = (self.driven[next - 1], self.driven[next]);
        pose_between(self.poses[next - 1], self.poses[next], (s - before) / (after - before).max(1e-12))
    }
}

/// The partner as it drove, straight on after its last state.
struct OtherTrack<'a> {
    traffic: &'a Traffic,
    row: usize,
    /// Columns of the time at which drivers take over, and of the last state of the unbroken stretch.
    from: usize,
    last: usize,
}

impl<'a> OtherTrack<'a> {
    fn new(traffic: &'a Traffic, id: i64, from: i64) -> Self {
        let row = traffic.row(id).expect("it was looked up before");
        let from = (from - traffic.states.first_time_step) as usize;
        let last = (from..traffic.states.n_steps).take_while(|column| traffic.is_there(row, *column)).last();
        Self { traffic, row, from, last: last.unwrap_or(from) }
    }

    /// Pose and speed after a time [s].
    fn at(&self, time: f64) -> (Pose, f64) {
        let column = self.from as f64 + time / self.traffic.dt;
        let speed = |column: usize| self.traffic.states.velocity[self.traffic.index(self.row, column)];
        if column >= self.last as f64 {
            let (pose, velocity) = (self.traffic.pose(self.row, self.last), speed(self.last));
            let onwards = (column - self.last as f64) * self.traffic.dt * velocity;
            let position = pose.position + Point::from_angle(pose.orientation) * onwards;
            return (Pose { position, ..pose }, velocity);
        }
        let (before, share) = (column as usize, column.fract());
        let pose = pose_between(self.traffic.pose(self.row, before), self.traffic.pose(self.row, before + 1), share);
        (pose, speed(before) + share * (speed(before + 1) - speed(before)))
    }
}

fn replacement(
    pair: &Pair<'_>,
    way: &Way,
    other: &OtherTrack<'_>,
    (driver, from): (Driver, usize),
    judged: &Preventability,
) -> Replacement {
    let (agent, shape, step) = (&pair.agent, pair.other.shape, judged.step);
    let n_steps = ((judged.time + AFTERWARDS) / step).ceil() as usize;
    let mut reaction = Reaction::new(driver);
    let (mut s, mut velocity, mut acceleration) = (0.0, judged.velocity.max(0.0), 0.0);
    let (mut here, (mut there, mut other_velocity)) = (way.at(from, 0.0), other.at(0.0));
    let mut found = Replacement {
        avoids: true,
        impact_speed: f64::NAN,
        distance: f64::INFINITY,
        velocity: vec![velocity],
        poses: vec![here],
    };
    for i in 1..=n_steps {
        let seen = seen(agent, (here, velocity, acceleration), &pair.other, (there, other_velocity));
        let before = velocity;
        velocity = (velocity - reaction.brake(&seen, step) * step).max(0.0);
        acceleration = (velocity - before) / step;
        s += velocity * step;
        let (next, (moved, speed)) = (way.at(from, s), other.at(i as f64 * step));
        if first_contact(agent.shape, here, next, shape, there, moved).is_some() {
            let along = |pose: Pose, speed: f64| Point::from_angle(pose.orientation) * speed;
            (found.avoids, found.distance) = (false, 0.0);
            found.impact_speed = (along(next, velocity) - along(moved, speed)).norm();
        } else {
            found.distance = found.distance.min(agent.shape.distance(next, shape, moved));
        }
        (here, there, other_velocity) = (next, moved, speed);
        found.velocity.push(velocity);
        found.poses.push(here);
        if !found.avoids {
            break;
        }
    }
    found
}

/// What the driver sees of the partner, in the frame of its own heading.
fn seen(
    agent: &Track<'_>,
    (here, velocity, acceleration): (Pose, f64, f64),
    other: &Track<'_>,
    (there, other_velocity): (Pose, f64),
) -> Seen {
    let (a, b) = (agent.shape.oriented_box(here), other.shape.oriented_box(there));
    let axis = Point::from_angle(here.orientation);
    let (offset, cos) = (b.center - a.center, axis.dot(b.axis).abs());
    let sin = axis.cross(b.axis).abs();
    let half = b.half_length * cos + b.half_width * sin;
    Seen {
        velocity,
        acceleration,
        other_velocity: other_velocity * axis.dot(Point::from_angle(there.orientation)),
        gap: offset.dot(axis).abs() - half - a.half_length,
        side: axis.cross(offset).abs() - b.half_length * sin - b.half_width * cos - a.half_width,
        toward: 0.0,
        is_ahead: offset.dot(axis) >= 0.0,
        lengths: 2.0 * (half + a.half_length),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Shape;
    use crate::road::testing::straight_road;
    use crate::trajectory::{State, States};
    use std::sync::Arc;

    const DT: f64 = 0.1;

    /// Speed and position of both along x at each step; the agent is 1.
    fn traffic(steps: usize, motion: impl Fn(usize) -> [(f64, f64, f64); 2]) -> Traffic {
        let mut states = States::absent(vec![1, 2], 0, steps);
        for step in 0..steps {
            for (row, (x, y, velocity)) in motion(step).into_iter().enumerate() {
                states.set(row, step, &State { x, y, velocity, ..State::default() });
            }
        }
        let shapes = vec![Shape::rectangle(4.5, 1.8); 2];
        Traffic::new(DT, Arc::new(straight_road(1)), states, shapes, vec![false; 2]).expect("traffic")
    }

    fn verdict(traffic: &Traffic, time_step: i64) -> Preventability {
        let conflict = Conflict { agent: 1, partner: 2, time_step, is_contact: true, is_pedestrian: false };
        preventability(traffic, &[conflict]).expect("a verdict").remove(0)
    }

    /// Both keep their speeds; the other comes from the side at step 20 with a gap [m].
    fn cut_in(gap: f64, (velocity, other): (f64, f64)) -> (Traffic, i64) {
        let after = gap / (velocity - other);
        let steps = 20 + (after / DT) as usize + 2;
        let at = |step: usize| {
            let time = (step as f64 - 20.0) * DT;
            let y = if step < 20 { 3.5 } else { 0.0 };
            [(velocity * time, 0.0, velocity), (gap + 4.5 + other * time, y, other)]
        };
        (traffic(steps, at), steps as i64 - 1)
    }

    #[test]
    fn a_leader_that_enters_30_m_ahead_is_for_all_and_one_3_m_ahead_for_none() {
        let (far, contact) = cut_in(30.0, (15.0, 10.0));
        let found = verdict(&far, contact);
        assert_eq!((found.undefined, found.from, found.velocity), (Undefined::Not, 20, 15.0));
        assert!(found.replacements.iter().all(|one| one.avoids && one.impact_speed.is_nan() && one.distance > 0.0));
        let (near, contact) = cut_in(3.0, (15.0, 10.0));
        let found = verdict(&near, contact);
        assert_eq!(found.from, 20);
        assert!(found.replacements.iter().all(|one| !one.avoids && one.impact_speed > 0.0 && one.distance == 0.0));
        // 0.6 s with a delay of 0.75 s: `Rss` hits it with all of the difference.
        assert!((found.replacements[2].impact_speed - 5.0).abs() < 1e-9);
    }

    #[test]
    fn a_standing_agent_one_hit_from_behind_and_crossing_ways_have_no_verdict() {
        let behind = |velocity: f64| {
            traffic(40, move |step| {
                let time = step as f64 * DT;
                [(50.0 + velocity * time, 0.0, velocity), (6.5 + (velocity + 10.0) * time, 0.0, velocity + 10.0)]
            })
        };
        assert_eq!(verdict(&behind(0.0), 39).undefined, Undefined::Stood);
        assert_eq!(verdict(&behind(5.0), 39).undefined, Undefined::Behind);
        let mut states = States::absent(vec![1, 2], 0, 11);
        for step in 0..11 {
            let time = (step as f64 - 10.0) * DT;
            states.set(0, step, &State { x: 10.0 * time, velocity: 10.0, ..State::default() });
            let orientation = std::f64::consts::FRAC_PI_2;
            states.set(1, step, &State { x: 3.0, y: 5.0 * time, velocity: 5.0, orientation, ..State::default() });
        }
        let shapes = vec![Shape::rectangle(4.5, 1.8); 2];
        let road = Arc::new(straight_road(1));
        let crossing = Traffic::new(DT, road, states, shapes, vec![false; 2]).expect("traffic");
        let found = verdict(&crossing, 10);
        assert_eq!(found.undefined, Undefined::Crossing);
        assert!(found.replacements.is_empty());
    }

    /// Agent and partner keep their speeds; the lateral positions are those of the step.
    fn side_by_side(aside: impl Fn(usize) -> [f64; 2], ahead: f64) -> Traffic {
        let mut states = States::absent(vec![1, 2], 0, 31);
        for step in 0..31 {
            let x = 10.0 * step as f64 * DT;
            for (row, y) in aside(step).into_iter().enumerate() {
                let x = x + ahead * row as f64;
                states.set(row, step, &State { x, y, velocity: 10.0, ..State::default() });
            }
        }
        let shapes = vec![Shape::rectangle(4.5, 1.8); 2];
        Traffic::new(DT, Arc::new(straight_road(2)), states, shapes, vec![false; 2]).expect("traffic")
    }

    #[test]
    fn it_is_told_who_left_its_lane() {
        let steered = |step: usize| 0.06 * step.saturating_sub(1) as f64;
        let width = 3.5;
        let agent = side_by_side(|step| [steered(step), width], 2.0);
        let partner = side_by_side(|step| [0.0, width - steered(step)], 2.0);
        let both = side_by_side(|step| [0.5 * steered(step), width - 0.5 * steered(step)], 2.0);
        let entry = |traffic: &Traffic| verdict(traffic, 30).entry;
        assert_eq!((entry(&agent), entry(&partner), entry(&both)), (Entry::Agent, Entry::Partner, Entry::Both));
        let ahead = traffic(61, |step| {
            let time = step as f64 * DT;
            [(15.0 * time, 0.0, 15.0), (34.4 + 10.0 * time, 0.0, 10.0)]
        });
        assert_eq!((verdict(&ahead, 60).entry, verdict(&ahead, 60).from), (Entry::Ahead, 0));
    }

    #[test]
    fn a_vehicle_that_drives_over_a_border_all_along_has_not_left_its_lane() {
        let border = 1.75;
        // The flanks of both are 1.8 m apart at the end, so that they touch.
        let towards = |step: usize| 0.06 * step as f64;
        let entry = |aside: &dyn Fn(usize) -> [f64; 2]| verdict(&side_by_side(aside, 2.0), 30).entry;
        // Within its own lane the agent comes as near as its lane allows to a vehicle over the border.
        let within = entry(&|step| [-0.8 + 0.5 * towards(step), border + 0.6]);
        assert_eq!(within, Entry::Both);
        // It leaves its lane towards that vehicle, ...
        assert_eq!(entry(&|step| [towards(step), border + 1.0]), Entry::Agent);
        // ... or is over the border itself, and the other leaves its lane.
        assert_eq!(entry(&|step| [border - 0.4, 3.5 - towards(step)]), Entry::Partner);
        // One that begins over the border, keeps to its lane for a while, and comes back has left it.
        let returns = |step: usize| if step < 5 { 2.0 } else { 3.5 - 0.11 * step.saturating_sub(12) as f64 };
        assert_eq!(entry(&|step| [0.0, returns(step)]), Entry::Partner);
    }

    #[test]
    fn what_stands_in_the_way_is_ahead_from_the_first_step_whatever_rounding_leaves_of_the_contact() {
        for row in 0..40 {
            let (velocity, gap) = (10.0 + 0.37 * f64::from(row), 11.3 + 0.61 * f64::from(row));
            let steps = (gap / velocity / DT) as usize + 2;
            let at = |step: usize| [(velocity * step as f64 * DT, 0.0, velocity), (gap + 4.5, 0.3, 0.0)];
            let found = verdict(&traffic(steps, at), steps as i64 - 1);
            assert_eq!((found.from, found.entry), (0, Entry::Ahead), "{velocity} m/s, {gap} m");
        }
    }

    #[test]
    fn drivers_take_over_before_a_contact_that_nothing_led_to() {
        // The other comes from behind and beside the way, so that no footprint at a whole step is in it.
        let (far, contact) = (side_by_side(|step| [0.0, if step < 30 { 3.5 } else { 0.5 }], 0.0), 30);
        let found = verdict(&far, contact);
        assert_eq!(found.from, contact - 1);
        assert!(found.time > 0.0 && found.time <= DT, "{}", found.time);
    }

    #[test]
    fn traffic_that_comes_towards_the_agent_is_oncoming_and_one_that_reverses_before_it_is_too() {
        let towards = |orientation: f64, velocity: f64| {
            let mut states = States::absent(vec![1, 2], 0, 11);
            for step in 0..11 {
                let time = (step as f64 - 10.0) * DT;
                states.set(0, step, &State { x: 10.0 * time, velocity: 10.0, ..State::default() });
                let x = 4.3 + velocity * orientation.cos() * time;
                states.set(1, step, &State { x, velocity, orientation, ..State::default() });
            }
            let shapes = vec![Shape::rectangle(4.5, 1.8); 2];
            Traffic::new(DT, Arc::new(straight_road(1)), states, shapes, vec![false; 2]).expect("traffic")
        };
        assert_eq!(verdict(&towards(PI, 5.0), 10).undefined, Undefined::Oncoming);
        assert_eq!(verdict(&towards(0.0, -5.0), 10).undefined, Undefined::Oncoming);
        // It reverses as the agent drives: as any vehicle ahead.
        assert_eq!(verdict(&towards(PI, -5.0), 10).undefined, Undefined::Not);
    }

    #[test]
    fn of_a_near_miss_the_way_goes_on_for_a_second() {
        let (far, contact) = cut_in(30.0, (15.0, 10.0));
        let conflict =
            Conflict { agent: 1, partner: 2, time_step: contact - 8, is_contact: false, is_pedestrian: false };
        let found = preventability(&far, &[conflict]).expect("a verdict").remove(0);
        assert_eq!((found.undefined, found.from), (Undefined::Not, 20));
        assert!(found.replacements.iter().all(|one| one.avoids));
        let people = preventability(&far, &[Conflict { is_pedestrian: true, ..conflict }]).expect("a verdict");
        assert_eq!(people[0].undefined, Undefined::Pedestrian);
    }
}
