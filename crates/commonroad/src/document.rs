//! What a document contains, one field for each thing that it states.

use std::fmt;

/// Why a document is not read: one line without the name of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It is not well-formed XML, or declares a document type; in the words of the parser.
    Syntax(String),
    /// Its contents cannot be used.
    Content(String),
}

impl Refusal {
    /// A refusal of contents.
    pub fn of(text: impl Into<String>) -> Self {
        Self::Content(text.into())
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::Syntax(text) | Self::Content(text)) = self;
        formatter.write_str(text)
    }
}

/// Result of reading something.
pub type Read<T> = Result<T, Refusal>;

/// The contents of a document.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    /// Time between steps [s].
    pub dt: f64,
    /// The benchmark id as written.
    pub benchmark_id: String,
    /// Version of the format.
    pub version: String,
    /// In the order of the document, as all that follows.
    pub lanelets: Vec<Lanelet>,
    /// Those of the document; in 2018b also one for each speed limit of a lanelet.
    pub signs: Vec<Sign>,
    /// Traffic lights.
    pub lights: Vec<Light>,
    /// Intersections.
    pub intersections: Vec<Intersection>,
    /// Static ones first, then moving ones, those of the environment, and phantoms.
    pub obstacles: Vec<Obstacle>,
    /// Planning problems.
    pub problems: Vec<Problem>,
    /// One line for each of the first references to elements that do not exist, and what is missing otherwise.
    pub notes: Vec<String>,
}

/// One bound of a lanelet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bound {
    /// Coordinates of the vertices, row by row [m].
    pub points: Vec<f64>,
    /// Coordinates of a vertex: 2, or 3 with heights.
    pub columns: usize,
    /// The line on it.
    pub marking: &'static str,
}

/// A lanelet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lanelet {
    /// Its id.
    pub id: i64,
    /// Left bound, in driving direction.
    pub left: Bound,
    /// Right bound, with as many vertices.
    pub right: Bound,
    /// Lanelets before it; here and below only those that exist.
    pub predecessors: Vec<i64>,
    /// Lanelets after it.
    pub successors: Vec<i64>,
    /// Left neighbour, and whether it runs in the same direction.
    pub adjacent_left: Option<(i64, bool)>,
    /// The same on the right.
    pub adjacent_right: Option<(i64, bool)>,
    /// Its stop line.
    pub stop_line: Option<StopLine>,
    /// Kinds of the lanelet.
    pub types: Vec<&'static str>,
    /// Who may use it, in one direction or both.
    pub users: Vec<&'static str>,
    /// Signs that count on it, sorted.
    pub signs: Vec<i64>,
    /// Traffic lights that count on it, sorted.
    pub lights: Vec<i64>,
}

/// A stop line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StopLine {
    /// Its ends [m]; those of the lanelet's bounds where it states none.
    pub ends: [[f64; 2]; 2],
    /// Signs that it refers to, sorted.
    pub signs: Vec<i64>,
    /// Lights that it refers to, sorted.
    pub lights: Vec<i64>,
}

/// A traffic sign.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sign {
    /// Its id.
    pub id: i64,
    /// Its elements.
    pub elements: Vec<SignElement>,
}

/// An element of a sign.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SignElement {
    /// What it says of limits in the country of the document, or "OTHER".
    pub name: &'static str,
    /// Its code as written.
    pub code: String,
    /// Its first value.
    pub value: Option<String>,
}

/// A traffic light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Light {
    /// Its id.
    pub id: i64,
    /// Where it stands [m], if stated.
    pub position: Option<[f64; 2]>,
    /// What it shows, and for how many time steps.
    pub phases: Vec<(&'static str, i64)>,
    /// Time step of the cycle's beginning.
    pub offset: i64,
    /// Ways for which it counts.
    pub direction: &'static str,
    /// Whether it is switched on.
    pub active: bool,
}

/// An intersection.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intersection {
    /// Its id.
    pub id: i64,
    /// Its incoming elements.
    pub incomings: Vec<Incoming>,
    /// Lanelets of its crossing.
    pub crossings: Vec<i64>,
}

/// An incoming element; ids of lanelets, sorted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Incoming {
    /// Its id.
    pub id: i64,
    /// Lanelets that lead to the intersection.
    pub lanelets: Vec<i64>,
    /// Lanelets that lead on from there to the right.
    pub right: Vec<i64>,
    /// Straight on.
    pub straight: Vec<i64>,
    /// To the left.
    pub left: Vec<i64>,
}

/// A footprint in the frame of its body, or an area in that of the world.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A rectangle.
    Rectangle {
        /// Along its own orientation [m].
        length: f64,
        /// Across it [m].
        width: f64,
        /// Centre [m].
        center: [f64; 2],
        /// Orientation [rad].
        orientation: f64,
    },
    /// A circle.
    Circle {
        /// Radius [m].
        radius: f64,
        /// Centre [m].
        center: [f64; 2],
    },
    /// Vertices, row by row [m].
    Polygon(Vec<f64>),
    /// Several shapes.
    Group(Vec<Shape>),
}

/// A value that may be uncertain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<T> {
    /// A number.
    Exact(T),
    /// Anything from the first to the second.
    Interval(T, T),
}

/// Where a state is.
#[derive(Clone, Debug, PartialEq)]
pub enum Position {
    /// At a point [m].
    Point([f64; 2]),
    /// Somewhere in an area.
    Area(Shape),
}

/// A state as far as it is stated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Where.
    pub position: Option<Position>,
    /// When.
    pub time_step: Option<Value<i64>>,
    /// Heading [rad].
    pub orientation: Option<Value<f64>>,
    /// Speed along the heading, of a point mass along x [m/s].
    pub velocity: Option<Value<f64>>,
    /// Acceleration [m/s²].
    pub acceleration: Option<Value<f64>>,
    /// Yaw rate [rad/s].
    pub yaw_rate: Option<Value<f64>>,
    /// Speed of a point mass along y [m/s].
    pub velocity_y: Option<Value<f64>>,
}

/// What an obstacle is to the scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// It stands for ever.
    Static,
    /// It may move.
    Dynamic,
    /// A building or the like, in the frame of the world.
    Environment,
    /// Nobody sees it.
    Phantom,
}

/// How an obstacle goes on after its first state.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Course {
    /// Nothing is stated.
    #[default]
    None,
    /// States of numbers alone: time steps, and rows of x, y, orientation, velocity, acceleration and yaw rate, nan where
    /// not stated.
    Table(Vec<i64>, Vec<f64>),
    /// States of which some are uncertain.
    States(Vec<State>),
}

/// An obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Its id.
    pub id: i64,
    /// Its role.
    pub role: Role,
    /// Its kind; empty for phantoms.
    pub kind: &'static str,
    /// Footprint; phantoms have none.
    pub shape: Option<Shape>,
    /// First state; only what stands or moves has one.
    pub initial: State,
    /// What follows.
    pub course: Course,
    /// Whether its future is stated as a set of areas.
    pub has_set: bool,
}

/// A planning problem.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problem {
    /// Its id.
    pub id: i64,
    /// Start.
    pub initial: State,
    /// Alternatives of the goal, and the lanelets in which each is.
    pub goals: Vec<(State, Vec<i64>)>,
}
