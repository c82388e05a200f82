//! Traffic signs, traffic lights and intersections.

use std::collections::{BTreeMap, BTreeSet};

use crate::document::{Incoming, Intersection, Lanelet, Light, Read, Sign, SignElement};
use crate::names::{self, LIGHT_DIRECTIONS, LIGHT_STATES};
use crate::roads::references;
use crate::shapes;
use crate::tree::{Element, Tree, id};

/// What of several elements with one id counts: the first.
fn first_of_each<T>(found: Vec<T>, id_of: impl Fn(&T) -> i64, what: &str, notes: &mut Vec<String>) -> Vec<T> {
    let mut seen = BTreeSet::new();
    let mut kept = Vec::with_capacity(found.len());
    for one in found {
        let number = id_of(&one);
        if seen.insert(number) {
            kept.push(one);
        } else {
            notes.push(format!("two {what} have the id {number}, the first counts"));
        }
    }
    kept
}

/// All traffic signs.
pub fn signs(root: Element<'_>, lanelets: &[Lanelet], country: &str, notes: &mut Vec<String>) -> Read<Vec<Sign>> {
    let begun = begun_signs(lanelets);
    let found: Vec<Sign> =
        root.all("trafficSign").map(|element| sign(element, country, &begun)).collect::<Read<_>>()?;
    Ok(first_of_each(found, |sign| sign.id, "traffic signs", notes))
}

/// For each sign that lanelets refer to whether a way enters its reach: a lanelet none of whose predecessors has it.
fn begun_signs(lanelets: &[Lanelet]) -> BTreeMap<i64, bool> {
    let by_id: BTreeMap<i64, &Lanelet> = lanelets.iter().map(|lanelet| (lanelet.id, lanelet)).collect();
    let mut begun = BTreeMap::new();
    for lanelet in lanelets {
        for sign in &lanelet.signs {
            let goes_on = lanelet.predecessors.iter().any(|before| by_id[before].signs.contains(sign));
            *begun.entry(*sign).or_insert(false) |= !goes_on;
        }
    }
    begun
}

fn sign(element: Element<'_>, country: &str, begun: &BTreeMap<i64, bool>) -> Read<Sign> {
    let number = id(element)?;
    let Some(is_begun) = begun.get(&number) else {
        return Err(element.refused(&format!("traffic sign {number} is not referenced by a lanelet!")));
    };
    let mut elements = Vec::new();
    for part in element.all("trafficSignElement") {
        let code = part.need("trafficSignID")?.words().into_owned();
        let value = part.first("additionalValue").map(|value| value.words().into_owned());
        elements.push(SignElement { name: names::sign(country, &code), code, value });
    }
    match element.first("position") {
        Some(position) => drop(shapes::point(position.need("point")?)?),
        None if *is_begun => {}
        None => return Err(element.refused("it has no position, and its lanelets have no beginning")),
    }
    Ok(Sign { id: number, elements })
}

/// All traffic lights; those without a cycle are dark.
pub fn lights(root: Element<'_>, lanelets: &[Lanelet], notes: &mut Vec<String>) -> Read<Vec<Light>> {
    let placed: BTreeSet<i64> = lanelets.iter().flat_map(|lanelet| &lanelet.lights).copied().collect();
    let dark: Vec<&str> = root
        .all("trafficLight")
        .filter(|light| light.path("cycle/cycleElement").is_empty())
        .map(|light| light.attribute("id").unwrap_or("?"))
        .collect();
    if !dark.is_empty() {
        notes.push(format!("traffic lights without a cycle are dark: {}", dark.join(", ")));
    }
    let found: Vec<Light> = root.all("trafficLight").map(|element| light(element, &placed)).collect::<Read<_>>()?;
    Ok(first_of_each(found, |light| light.id, "traffic lights", notes))
}

fn light(element: Element<'_>, placed: &BTreeSet<i64>) -> Read<Light> {
    let number = id(element)?;
    let position = match element.first("position") {
        Some(position) => Some(shapes::point_in_plane(position.need("point")?)?),
        None if placed.contains(&number) => None,
        None => return Err(element.refused("it is not referenced by a lanelet, and has no position")),
    };
    let direction = element.first("direction").map(|one| one.words());
    let known = direction.and_then(|text| LIGHT_DIRECTIONS.iter().find(|name| **name == text.as_ref()));
    let (phases, offset) = cycle(element)?;
    Ok(Light {
        id: number,
        position,
        phases,
        offset,
        direction: known.copied().unwrap_or("all"),
        active: element.first("active").is_none_or(|active| active.words() != "false"),
    })
}

fn cycle(light: Element<'_>) -> Read<(Vec<(&'static str, i64)>, i64)> {
    if light.path("cycle/cycleElement").is_empty() {
        return Ok((vec![("inactive", 1)], 0));
    }
    let cycle = light.need("cycle")?;
    let mut phases = Vec::new();
    for element in cycle.all("cycleElement") {
        let (color, duration) = (element.need("color")?, element.need("duration")?.whole()?);
        phases.push((color.one_of(&LIGHT_STATES, "traffic light state")?, duration));
    }
    let offset = cycle.first("timeOffset").map_or(Ok(0), |offset| offset.whole())?;
    Ok((phases, offset))
}

/// All intersections.
pub fn intersections(root: Element<'_>, notes: &mut Vec<String>) -> Read<Vec<Intersection>> {
    let found: Vec<Intersection> = root.all("intersection").map(intersection).collect::<Read<_>>()?;
    Ok(first_of_each(found, |one| one.id, "intersections", notes))
}

fn intersection(element: Element<'_>) -> Read<Intersection> {
    let crossings = element.first("crossing").map_or(Ok(Vec::new()), |one| references(one, "crossingLanelet"))?;
    let incomings = element.all("incoming").map(incoming).collect::<Read<_>>()?;
    for outgoing in element.all("outgoing") {
        id(outgoing)?;
        references(outgoing, "outgoingLanelet")?;
    }
    Ok(Intersection { id: id(element)?, incomings, crossings })
}

fn incoming(element: Element<'_>) -> Read<Incoming> {
    let way = |name: &str| {
        let mut found = references(element, &format!("outgoing{name}"))?;
        found.extend(references(element, &format!("successors{name}"))?);
        found.sort_unstable();
        found.dedup();
        Ok(found)
    };
    Ok(Incoming {
        id: id(element)?,
        lanelets: references(element, "incomingLanelet")?,
        right: way("Right")?,
        straight: way("Straight")?,
        left: way("Left")?,
    })
}
