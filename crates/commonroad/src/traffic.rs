//! Obstacles.

use crate::document::{Course, Obstacle, Position, Read, Refusal, Role, Shape, State, Value};
use crate::names::OBSTACLE_TYPES;
use crate::shapes;
use crate::states;
use crate::tree::{Element, Tree, id};

/// All obstacles. Those of another version than that of the document are checked and left out.
pub fn obstacles(root: Element<'_>, version: &str) -> Read<Vec<Obstacle>> {
    let mut found = Vec::new();
    for tag in ["obstacle", "staticObstacle", "dynamicObstacle"] {
        for element in root.all(tag) {
            let (role, shape) = footprint(element)?;
            if (tag == "obstacle") == (version == "2018b") {
                found.push(recorded(element, role, shape)?);
            }
        }
    }
    if version != "2018b" {
        for element in root.all("environmentObstacle") {
            let shape = shapes::area(element.need("shape")?)?;
            let wrong = || {
                Refusal::of(format!(
                    "the shape of obstacle {} cannot be read; correct it",
                    element.attribute("id").unwrap_or("?")
                ))
            };
            let mut parts: Vec<Shape> = shape.into_iter().collect::<Option<_>>().ok_or_else(wrong)?;
            let shape = if parts.len() == 1 { parts.remove(0) } else { Shape::Group(parts) };
            found.push(obstacle(element, Role::Environment, kind(element)?, Some(shape))?);
        }
        for element in root.all("phantomObstacle") {
            element.first("occupancySet").map_or(Ok(()), states::check_set)?;
            found.push(obstacle(element, Role::Phantom, "", None)?);
        }
    }
    Ok(found)
}

fn obstacle(element: Element<'_>, role: Role, kind: &'static str, shape: Option<Shape>) -> Read<Obstacle> {
    let (initial, course) = (State::default(), Course::None);
    Ok(Obstacle { id: id(element)?, role, kind, shape, initial, course, has_set: false })
}

fn kind(element: Element<'_>) -> Read<&'static str> {
    element.need("type")?.one_of(&OBSTACLE_TYPES, "obstacle type")
}

/// Role and footprint, without which nothing is an obstacle.
fn footprint(element: Element<'_>) -> Read<(Role, Shape)> {
    let number = id(element)?;
    let what = format!("obstacle {number}");
    let role = match element.tag_name().name() {
        "staticObstacle" => Role::Static,
        "dynamicObstacle" => Role::Dynamic,
        _ => match element.first("role").map(|role| role.words()).as_deref() {
            Some("static") => Role::Static,
            Some("dynamic") => Role::Dynamic,
            _ => return Err(Refusal::of(format!("{what} has no role static or dynamic; add it"))),
        },
    };
    if element.first("initialState").is_none() {
        return Err(Refusal::of(format!("{what} has no initial state; add one")));
    }
    let Some(shape) = element.first("shape").filter(|shape| shape.elements().next().is_some()) else {
        return Err(Refusal::of(format!("{what} has no shape; add one")));
    };
    Ok((role, shapes::footprint(shape, number)?))
}

fn recorded(element: Element<'_>, role: Role, shape: Shape) -> Read<Obstacle> {
    let mut found = obstacle(element, role, kind(element)?, Some(shape))?;
    let start = element.need("initialState")?;
    found.initial = states::initial(start, &format!("obstacle {}", found.id))?;
    // commonroad-io puts the footprint of a certain state at its position, which then must be one in the plane.
    let is_certain = matches!(found.initial.position, Some(Position::Point(_)))
        && !matches!(found.initial.orientation, Some(Value::Interval(..)));
    if is_certain && !start.path("position/point/z").is_empty() {
        return Err(start.refused("its position has a height"));
    }
    if role == Role::Static {
        return Ok(found);
    }
    let trajectory = element.first("trajectory");
    if let Some(trajectory) = trajectory {
        found.course = states::course(trajectory)?;
    }
    if let Some(set) = element.first("occupancySet").filter(|_| found.course == Course::None) {
        states::check_set(set)?;
        found.has_set = true;
    }
    Ok(found)
}
