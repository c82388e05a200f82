//! States of obstacles and planning problems.

use std::f64::consts::TAU;

use crate::document::{Course, Position, Read, Refusal, State, Value};
use crate::names::ANY_HEADING;
use crate::shapes;
use crate::tree::{Element, Tree};
use crate::values::{real, whole};

/// Columns of a table of states after x and y.
const COLUMNS: [&str; 4] = ["orientation", "velocity", "acceleration", "yawRate"];

/// The first state of an obstacle or a planning problem.
///
/// An element that is missing is not stated. Where velocities are stated along both axes, the values after the first
/// missing one count as 0, as in commonroad-io.
pub fn initial(element: Element<'_>, owner: &str) -> Read<State> {
    let (Some(time), Some(position)) = (element.first("time"), element.first("position")) else {
        return Err(Refusal::of(format!("{owner} has a state without position or time; add it")));
    };
    let mut state =
        State { time_step: Some(time_step(time)?), position: Some(place(position, None)?), ..State::default() };
    let is_point_mass = element.first("velocityY").is_some();
    let mut is_behind_gap = false;
    for name in COLUMNS {
        let found = headings(element, name).next();
        is_behind_gap |= is_point_mass && found.is_none();
        let value = match found {
            Some(_) if is_behind_gap => Some(Value::Exact(0.0)),
            Some(found) => Some(value_of(found)?),
            None => None,
        };
        *column(&mut state, name) = value;
    }
    if let Some(slip) = element.first("slipAngle").filter(|_| !is_behind_gap) {
        value(slip)?;
    }
    Ok(state)
}

/// Children of a name, without headings that may be anything.
fn headings<'a, 'b>(element: Element<'a>, name: &'b str) -> impl Iterator<Item = Element<'a>> + use<'a, 'b> {
    element.children().filter(move |child| child.is(name) && !(name == "orientation" && is_any_heading(*child)))
}

fn column<'a>(state: &'a mut State, name: &str) -> &'a mut Option<Value<f64>> {
    match name {
        "orientation" => &mut state.orientation,
        "velocity" => &mut state.velocity,
        "acceleration" => &mut state.acceleration,
        "velocityY" => &mut state.velocity_y,
        _ => &mut state.yaw_rate,
    }
}

/// Whether a heading is an interval of a full turn or more.
pub fn is_any_heading(heading: Element<'_>) -> bool {
    let end = |name: &str| heading.first(name).and_then(|end| real(&end.words()));
    matches!((end("intervalStart"), end("intervalEnd")), (Some(first), Some(last)) if last - first >= ANY_HEADING)
}

/// The states after the first one.
pub fn course(trajectory: Element<'_>) -> Read<Course> {
    if let Some((steps, values)) = table(trajectory) {
        return Ok(Course::Table(steps, values));
    }
    let states: Vec<(State, Vec<String>)> =
        trajectory.all("state").map(|state| later(state, None)).collect::<Read<_>>()?;
    let Some((_, attributes)) = states.first() else { return Err(trajectory.unreadable()) };
    if states.iter().any(|(state, _)| !matches!(state.time_step, Some(Value::Exact(_)))) {
        return Err(trajectory.refused("the time step of each state must be a whole number"));
    }
    if states.iter().any(|(_, others)| others != attributes) {
        return Err(trajectory.refused("all states must have the same attributes"));
    }
    Ok(Course::States(states.into_iter().map(|(state, _)| state).collect()))
}

/// Time steps and columns of states; `None` where one is uncertain, broken, or has velocities along two axes.
pub fn table(trajectory: Element<'_>) -> Option<(Vec<i64>, Vec<f64>)> {
    let (mut steps, mut values) = (Vec::new(), Vec::new());
    for state in trajectory.all("state") {
        let mut row = [f64::NAN; 6];
        let mut is_stated = [false; 6];
        let mut step = None;
        for child in state.elements() {
            let name = child.tag_name().name();
            let at = match name {
                "position" => 0,
                "time" => 1,
                "velocityY" => return None,
                _ => match COLUMNS.iter().position(|column| *column == name) {
                    Some(column) => column + 2,
                    None => continue,
                },
            };
            if is_stated[at] || !child.is(name) {
                continue;
            }
            is_stated[at] = true;
            let inner = child.first(if name == "position" { "point" } else { "exact" })?;
            match name {
                "position" => (row[0], row[1]) = (inner.real_of("x").ok()?, inner.real_of("y").ok()?),
                "time" => step = Some(i64::try_from(whole(&inner.words())?).ok()?),
                _ => row[at] = real(&inner.words())?,
            }
        }
        if !is_stated[0] {
            return None;
        }
        steps.push(step?);
        values.extend(row);
    }
    if steps.is_empty() { None } else { Some((steps, values)) }
}

/// A state of any kind and the names of everything that it states; `lanelets` are found by the goals that name them.
pub fn later(element: Element<'_>, lanelets: Option<&mut Vec<i64>>) -> Read<(State, Vec<String>)> {
    let mut state = State::default();
    let mut names = Vec::new();
    let mut lanelets = lanelets;
    time_step(element.need("time")?)?;
    for child in element.elements() {
        let name = child.tag_name().name();
        if name == "orientation" && is_any_heading(child) {
            continue;
        }
        match name {
            "position" => state.position = Some(place(element.need(name)?, lanelets.as_deref_mut())?),
            "time" => state.time_step = Some(time_step(element.need(name)?)?),
            _ => {
                let known = round_trip(name);
                let found = headings(element, &known).next();
                let Some(found) = found else {
                    break; // commonroad-io does not read what follows a name that it does not know
                };
                let value = value_of(found)?;
                if COLUMNS.contains(&name) || name == "velocityY" {
                    *column(&mut state, name) = Some(value);
                }
            }
        }
        names.push(name.to_string());
    }
    names.sort_unstable();
    names.dedup();
    Ok((state, names))
}

/// A name as commonroad-io finds it again after it has made an attribute of it: `yawRate`, `yaw_rate`, `yawRate`.
fn round_trip(name: &str) -> String {
    let mut attribute = String::new();
    for (at, letter) in name.chars().enumerate() {
        if at > 0 && letter.is_ascii_uppercase() {
            attribute.push('_');
        }
        attribute.extend(letter.to_lowercase());
    }
    let mut found = String::new();
    let mut letters = attribute.chars().peekable();
    while let Some(letter) = letters.next() {
        match (letter, letters.peek().copied()) {
            ('_', Some(next)) if next.is_alphanumeric() || next == '_' => {
                found.extend(next.to_uppercase());
                letters.next();
            }
            _ => found.push(letter),
        }
    }
    found
}

/// A value, of headings as an interval of angles.
fn value_of(element: Element<'_>) -> Read<Value<f64>> {
    if element.is("orientation") { heading(element) } else { value(element) }
}

/// A number or an interval.
pub fn value(element: Element<'_>) -> Read<Value<f64>> {
    if let Some(exact) = element.first("exact") {
        return Ok(Value::Exact(exact.real()?));
    }
    let (first, last) = (element.need("intervalStart")?, element.need("intervalEnd")?);
    interval(element, first.real()?, last.real()?)
}

fn interval<T: PartialOrd + std::fmt::Debug>(element: Element<'_>, first: T, last: T) -> Read<Value<T>> {
    if first <= last {
        return Ok(Value::Interval(first, last));
    }
    Err(element.refused(&format!("start of interval must be <= end, but start {first:?} > end {last:?}")))
}

/// A time step or an interval of them.
fn time_step(element: Element<'_>) -> Read<Value<i64>> {
    if let Some(exact) = element.first("exact") {
        return Ok(Value::Exact(exact.whole()?));
    }
    let (first, last) = (element.need("intervalStart")?, element.need("intervalEnd")?);
    interval(element, first.whole()?, last.whole()?)
}

/// A heading or an interval of headings, brought to within a turn of 0.
fn heading(element: Element<'_>) -> Read<Value<f64>> {
    let Value::Interval(mut first, mut last) = (match element.first("exact") {
        Some(exact) => Value::Exact(exact.real()?),
        None => Value::Interval(element.need("intervalStart")?.real()?, element.need("intervalEnd")?.real()?),
    }) else {
        return value(element);
    };
    while first > TAU || last > TAU {
        (first, last) = (first - TAU, last - TAU);
    }
    while first < -TAU {
        (first, last) = (first + TAU, last + TAU);
    }
    if last - first >= TAU || last.abs() > TAU {
        return Err(element.refused("an interval of headings must be less than a full turn"));
    }
    interval(element, first, last)
}

/// Where a state is; in a goal the position may be lanelets.
fn place(element: Element<'_>, lanelets: Option<&mut Vec<i64>>) -> Read<Position> {
    if let Some(point) = element.first("point") {
        return Ok(Position::Point(shapes::point_in_plane(point)?));
    }
    if ["rectangle", "circle", "polygon"].iter().any(|kind| element.first(kind).is_some()) {
        if let Some(found) = lanelets {
            *found = element.all("lanelet").map(|one| one.number("ref")).collect::<Read<_>>()?;
        }
        return Ok(Position::Area(shapes::known_area(element)?));
    }
    let Some(found) = lanelets else { return Err(element.unreadable()) };
    *found = element.all("lanelet").map(|one| one.number("ref")).collect::<Read<_>>()?;
    if found.is_empty() { Err(element.unreadable()) } else { Ok(Position::Area(crate::document::Shape::Group(vec![]))) }
}

/// A set of areas over time, of which only is of interest that it can be read.
pub fn check_set(set: Element<'_>) -> Read<()> {
    let mut is_empty = true;
    for occupancy in set.all("occupancy") {
        shapes::area(occupancy.need("shape")?)?;
        time_step(occupancy.need("time")?)?;
        is_empty = false;
    }
    if is_empty { Err(set.unreadable()) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_being_made_attributes() {
        for name in ["yawRate", "deltaYFront", "time", "positionZ"] {
            assert_eq!(round_trip(name), name);
        }
        assert_eq!(round_trip("Position"), "position");
        assert_eq!(round_trip("a_b"), "aB");
    }
}
