//! Lanelets with their stop lines.

use std::collections::BTreeSet;

use crate::document::{Bound, Lanelet, Read, StopLine};
use crate::names::{LANELET_TYPES, LINE_MARKINGS, ROAD_USERS};
use crate::shapes;
use crate::tree::{Element, Tree, id};

/// All lanelets; relations to lanelets that do not exist, as in maps cut out of larger ones, are left out.
pub fn lanelets(root: Element<'_>) -> Read<Vec<Lanelet>> {
    let known: BTreeSet<i64> = root.all("lanelet").map(id).collect::<Read<_>>()?;
    root.all("lanelet").map(|element| lanelet(element, &known)).collect()
}

/// The speed limit that a lanelet of the version 2018b states [m/s].
pub fn speed_limit(lanelet: Element<'_>) -> Read<Option<f64>> {
    lanelet.first("speedLimit").map(|limit| limit.real()).transpose()
}

fn lanelet(element: Element<'_>, known: &BTreeSet<i64>) -> Read<Lanelet> {
    let (left, right) = bounds(element)?;
    let one_way = names(element, "userOneWay", &ROAD_USERS, "road user")?;
    let users: BTreeSet<_> =
        one_way.into_iter().chain(names(element, "userBidirectional", &ROAD_USERS, "road user")?).collect();
    speed_limit(element)?;
    Ok(Lanelet {
        id: id(element)?,
        predecessors: related(element, "predecessor", known),
        successors: related(element, "successor", known),
        adjacent_left: neighbour(element, "adjacentLeft", known),
        adjacent_right: neighbour(element, "adjacentRight", known),
        stop_line: stop_line(element, &left, &right)?,
        types: names(element, "laneletType", &LANELET_TYPES, "lanelet type")?,
        users: users.into_iter().collect(),
        signs: references(element, "trafficSignRef")?,
        lights: references(element, "trafficLightRef")?,
        left,
        right,
    })
}

/// Ids that an element refers to, sorted, each once.
pub fn references(element: Element<'_>, name: &str) -> Read<Vec<i64>> {
    let found: BTreeSet<i64> = element.all(name).map(|one| one.number("ref")).collect::<Read<_>>()?;
    Ok(found.into_iter().collect())
}

fn related(element: Element<'_>, name: &str, known: &BTreeSet<i64>) -> Vec<i64> {
    element.all(name).filter_map(|one| one.number("ref").ok()).filter(|number| known.contains(number)).collect()
}

fn neighbour(element: Element<'_>, name: &str, known: &BTreeSet<i64>) -> Option<(i64, bool)> {
    element.all(name).find_map(|one| {
        let number = one.number("ref").ok().filter(|number| known.contains(number))?;
        Some((number, one.attribute("drivingDir") == Some("same")))
    })
}

fn names(element: Element<'_>, tag: &str, known: &[&'static str], kind: &str) -> Read<Vec<&'static str>> {
    let found: BTreeSet<_> = element.all(tag).map(|one| one.one_of(known, kind)).collect::<Read<_>>()?;
    Ok(found.into_iter().collect())
}

/// Both bounds. Points without a height have that of the point opposite; where both have none, none has.
fn bounds(element: Element<'_>) -> Read<(Bound, Bound)> {
    let sides = [element.need("leftBound")?, element.need("rightBound")?];
    let mut points = [Vec::new(), Vec::new()];
    for (side, found) in sides.iter().zip(&mut points) {
        *found = side.all("point").map(shapes::point).collect::<Read<Vec<_>>>()?;
    }
    let [left, right] = &mut points;
    let has_heights = left.iter().zip(right.iter()).all(|(one, other)| one.len() > 2 || other.len() > 2);
    let columns = if has_heights { 3 } else { 2 };
    for (one, other) in left.iter_mut().zip(right.iter_mut()) {
        let height = [&*one, &*other].into_iter().find_map(|point| point.get(2).copied());
        for point in [one, other] {
            point.truncate(columns);
            if point.len() < columns {
                point.extend(height);
            }
        }
    }
    let bound = |side: Element<'_>, points: &[Vec<f64>]| {
        let marking =
            side.first("lineMarking").map_or(Ok("unknown"), |one| one.one_of(&LINE_MARKINGS, "line marking"))?;
        Ok(Bound { points: points.concat(), columns, marking })
    };
    Ok((bound(sides[0], &points[0])?, bound(sides[1], &points[1])?))
}

fn stop_line(element: Element<'_>, left: &Bound, right: &Bound) -> Read<Option<StopLine>> {
    let Some(line) = element.first("stopLine") else { return Ok(None) };
    let points = shapes::points(line)?;
    if let Some(marking) = line.first("lineMarking") {
        marking.one_of(&LINE_MARKINGS, "line marking")?;
    }
    let last = |bound: &Bound| {
        let row = &bound.points[bound.points.len() - bound.columns..];
        [row[0], row[1]]
    };
    let ends = match points[..] {
        [first, second, ..] => [first, second],
        _ => [last(left), last(right)],
    };
    Ok(Some(StopLine {
        ends,
        signs: references(line, "trafficSignRef")?,
        lights: references(line, "trafficLightRef")?,
    }))
}
