//! The scenarios that come with the package as worlds, for tests and measurements that must not need Python. Reads what
//! `scenarios/make.py` writes and nothing else.

#![allow(dead_code, reason = "every test and measurement uses a part of it")]

use std::sync::Arc;

use interdrive_core::geometry::shape::{PlacedShape, Shape};
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::plan::Planner;
use interdrive_core::road::{LaneletInput, RoadNetwork, RoadSettings, Users};
use interdrive_core::route::{RouteSettings, find_route};
use interdrive_core::rules::RulesSettings;
use interdrive_core::scenario::{Goal, GoalState, Obstacles, Scenario};
use interdrive_core::scene::ViewLimits;
use interdrive_core::trajectory::{State, States};
use interdrive_core::vehicle::{ParticipantKind, Vehicle};
use interdrive_core::world::{Agent, World, WorldSettings};

/// Seven recorded vehicles and a planning problem.
pub const T_JUNCTION: &str = include_str!("../../../../python/interdrive/data/t_junction.xml");
/// A thousand planning problems.
pub const TOWN: &str = include_str!("../../../../python/interdrive/data/town.xml");

const DT: f64 = 0.1;
/// Goals of recorded vehicles: a rectangle of this size around the last recorded position [m].
const GOAL_SIZE: (f64, f64) = (10.0, 4.0);

/// An agent to be: id, kind, footprint, state, goal.
struct Proposal {
    id: i64,
    kind: ParticipantKind,
    size: (f64, f64),
    state: State,
    goal: GoalState,
}

/// A world in which the first vehicles by id, at most `agents`, plan with `planner`: planning problems, and recorded
/// vehicles with a goal where their recording ends. Other recorded vehicles stay recorded.
pub fn world(document: &str, agents: usize, planner: &Planner, settings: WorldSettings) -> World {
    let (scenario, agents) = cast(document, agents, planner);
    World::new(scenario, agents, settings).expect("a world")
}

/// The scenario, and the first vehicles by id, at most `agents`, as agents with `planner`.
pub fn cast(document: &str, agents: usize, planner: &Planner) -> (Arc<Scenario>, Vec<Agent>) {
    let lanelets: Vec<LaneletInput> = elements(document, "lanelet").map(lanelet).collect();
    let areas: Vec<(i64, Shape)> = lanelets.iter().map(|one| (one.id, polygon(one))).collect();
    let road = Arc::new(RoadNetwork::new(lanelets, RoadSettings::default()).expect("a road"));
    let (obstacles, mut proposals) = recorded(document);
    proposals.extend(elements(document, "planningProblem").map(|text| problem(text, &areas)));
    proposals.sort_by_key(|proposal| proposal.id);
    let agents = proposals.into_iter().take(agents).map(|proposal| agent(proposal, &road, planner)).collect();
    let scenario = Scenario::new(DT, road, obstacles).expect("a scenario");
    (Arc::new(scenario), agents)
}

fn agent(proposal: Proposal, road: &RoadNetwork, planner: &Planner) -> Agent {
    let Proposal { id, kind, size: (length, width), state, goal } = proposal;
    let route = find_route(road, state.pose(), state.velocity, &goal.areas, &RouteSettings::default());
    Agent {
        id,
        kind,
        shape: Shape::rectangle(length, width),
        vehicle: Vehicle::for_footprint(kind, length, width).expect("a vehicle"),
        initial_state: state,
        start_time_step: 0,
        replays_before: false,
        queue: None,
        goal: Goal { states: vec![goal], pace: None },
        route: Arc::new(route.expect("a route")),
        planner: planner.clone(),
        view: ViewLimits { sensor_radius: 80.0, ..ViewLimits::default() },
        rules: RulesSettings::default(),
        v2x: None,
    }
}

/// Recorded vehicles, and what they are as agents.
fn recorded(document: &str) -> (Obstacles, Vec<Proposal>) {
    let texts: Vec<&str> = elements(document, "dynamicObstacle").collect();
    let drives: Vec<Vec<State>> = texts
        .iter()
        .map(|text| elements(text, "initialState").chain(elements(text, "state")).map(state).collect())
        .collect();
    let n_steps = drives.iter().map(Vec::len).max().unwrap_or(1);
    let mut states = States::absent(texts.iter().map(|text| id(text)).collect(), 0, n_steps);
    let (mut kinds, mut shapes, mut proposals) = (vec![], vec![], vec![]);
    for (row, (text, drive)) in texts.iter().zip(&drives).enumerate() {
        let kind = match inside(text, "type") {
            "car" => ParticipantKind::Car,
            "truck" => ParticipantKind::Truck,
            "bus" => ParticipantKind::Bus,
            "motorcycle" => ParticipantKind::Motorcycle,
            other => panic!("no kind {other}"),
        };
        let size = (number(inside(text, "length")), number(inside(text, "width")));
        for (step, state) in drive.iter().enumerate() {
            states.set(row, step, state);
        }
        let last = drive.last().expect("a recording");
        let area = PlacedShape { shape: Shape::rectangle(GOAL_SIZE.0, GOAL_SIZE.1), pose: last.pose() };
        let time_step = (1, drive.len() as i64 + 9);
        let goal = GoalState { areas: [area].into(), time_step, velocity: None, orientation: None };
        proposals.push(Proposal { id: id(text), kind, size, state: drive[0], goal });
        kinds.push(kind);
        shapes.push(Shape::rectangle(size.0, size.1));
    }
    let is_static = vec![false; texts.len()];
    (Obstacles { kind: kinds, shape: shapes, is_static, states }, proposals)
}

fn problem(text: &str, areas: &[(i64, Shape)]) -> Proposal {
    let goal = inside(text, "goalState");
    let origin = Pose::new(0.0, 0.0, 0.0);
    let area = if let Some(rectangle) = elements(goal, "rectangle").next() {
        let (x, y) = point(inside(rectangle, "center"));
        let size = (number(inside(rectangle, "length")), number(inside(rectangle, "width")));
        let pose = Pose::new(x, y, number(inside(rectangle, "orientation")));
        PlacedShape { shape: Shape::rectangle(size.0, size.1), pose }
    } else {
        let wanted = references(goal, "lanelet").next().expect("a goal lanelet");
        let shape = areas.iter().find(|(id, _)| *id == wanted).expect("a lanelet").1.clone();
        PlacedShape { shape, pose: origin }
    };
    let step = |tag| number(inside(inside(goal, "time"), tag)) as i64;
    let time_step = (step("intervalStart"), step("intervalEnd"));
    let goal = GoalState { areas: [area].into(), time_step, velocity: None, orientation: None };
    let state = state(inside(text, "initialState"));
    Proposal { id: id(text), kind: ParticipantKind::Car, size: (4.508, 1.61), state, goal }
}

fn lanelet(text: &str) -> LaneletInput {
    let bound = |tag| elements(inside(text, tag), "point").map(point).map(|(x, y)| Point::new(x, y)).collect();
    let adjacent = |tag: &str| {
        let start = text.find(&format!("<{tag} "))?;
        let head = &text[start..start + text[start..].find('>').expect("an end")];
        Some((number(attribute(head, "ref")) as i64, attribute(head, "drivingDir") == "same"))
    };
    LaneletInput {
        id: id(text),
        left: bound("leftBound"),
        right: bound("rightBound"),
        predecessors: references(text, "predecessor").collect(),
        successors: references(text, "successor").collect(),
        adjacent_left: adjacent("adjacentLeft"),
        adjacent_right: adjacent("adjacentRight"),
        speed_limit: 50.0 / 3.6,
        users: Users::ALL,
    }
}

fn polygon(lanelet: &LaneletInput) -> Shape {
    let outline: Vec<Point> = lanelet.left.iter().chain(lanelet.right.iter().rev()).copied().collect();
    Shape::polygon(&outline).expect("a polygon")
}

fn state(text: &str) -> State {
    let (x, y) = point(inside(text, "position"));
    let exact = |tag| number(inside(inside(text, tag), "exact"));
    State { x, y, orientation: exact("orientation"), velocity: exact("velocity"), ..State::default() }
}

fn point(text: &str) -> (f64, f64) {
    (number(inside(text, "x")), number(inside(text, "y")))
}

/// Elements of one tag, which do not contain each other, from their attributes to their end.
fn elements<'a>(text: &'a str, tag: &'a str) -> impl Iterator<Item = &'a str> {
    let (open, close) = (format!("<{tag}"), format!("</{tag}>"));
    let mut rest = text;
    std::iter::from_fn(move || {
        loop {
            let start = rest.find(&open)? + open.len();
            rest = &rest[start..];
            let head = &rest[..rest.find('>')?];
            if rest.starts_with([' ', '>']) && !head.ends_with('/') {
                let end = rest.find(&close)?;
                let found = &rest[..end];
                rest = &rest[end + close.len()..];
                return Some(found);
            }
        }
    })
}

/// The inside of the first element of a tag.
fn inside<'a>(text: &'a str, tag: &'a str) -> &'a str {
    let found = elements(text, tag).next().unwrap_or_else(|| panic!("no {tag} in {text}"));
    &found[found.find('>').expect("an end") + 1..]
}

/// Ids of empty elements `<tag ref="id"/>`.
fn references<'a>(text: &'a str, tag: &str) -> impl Iterator<Item = i64> + use<'a> {
    let open = format!("<{tag} ref=\"");
    text.match_indices(&open)
        .map(|(at, found)| at + found.len())
        .collect::<Vec<_>>()
        .into_iter()
        .map(move |at| number(text[at..].split('"').next().expect("a value")) as i64)
}

fn id(text: &str) -> i64 {
    number(attribute(&text[..text.find('>').expect("an end")], "id")) as i64
}

fn attribute<'a>(head: &'a str, name: &str) -> &'a str {
    let start = head.find(&format!("{name}=\"")).expect("an attribute") + name.len() + 2;
    head[start..].split('"').next().expect("a value")
}

fn number(text: &str) -> f64 {
    text.parse().unwrap_or_else(|_| panic!("{text} is not a number"))
}
