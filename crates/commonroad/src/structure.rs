//! Refuses documents that cannot become a scenario: header, ids, neighbours in a circle, broken bounds, lost goals.

use std::collections::{BTreeMap, BTreeSet};

use crate::document::{Read, Refusal};
use crate::limits::{LARGEST_DT, SMALLEST_DT};
use crate::names::VERSIONS;
use crate::numbers;
use crate::tree::{Element, Tree, full_name, id};
use crate::values::{general, real, whole};

/// Elements that are obstacles.
pub const OBSTACLES: [&str; 5] =
    ["obstacle", "staticObstacle", "dynamicObstacle", "environmentObstacle", "phantomObstacle"];

/// Checks the document and returns the time between steps [s].
pub fn check(root: Element<'_>) -> Read<f64> {
    let dt = check_header(root)?;
    numbers::check(root)?;
    check_ids(root)?;
    check_adjacency(root)?;
    for lanelet in root.all("lanelet") {
        check_points(lanelet)?;
    }
    let lanelets: BTreeSet<&str> = root.all("lanelet").filter_map(|lanelet| lanelet.attribute("id")).collect();
    for problem in root.all("planningProblem") {
        for reference in problem.path("goalState/position/lanelet") {
            let target = reference.attribute("ref");
            if !target.is_some_and(|target| lanelets.contains(target)) {
                return Err(Refusal::of(format!(
                    "the goal of planning problem {} is lanelet {}, which does not exist; correct the reference",
                    problem.attribute("id").unwrap_or("None"),
                    target.unwrap_or("(without ref)")
                )));
            }
        }
    }
    Ok(dt)
}

fn check_header(root: Element<'_>) -> Read<f64> {
    if !root.is("commonRoad") {
        return Err(Refusal::of(format!(
            "<{}> is no map or scenario that is read here; give a CommonRoad, OpenDRIVE, Lanelet2 or SUMO net file",
            full_name(root)
        )));
    }
    match root.attribute("commonRoadVersion") {
        None => {
            return Err(Refusal::of(format!("states no commonRoadVersion; add it, {}", VERSIONS.join(" or "))));
        }
        Some(version) if !VERSIONS.contains(&version) => {
            return Err(Refusal::of(format!(
                "CommonRoad version {version} is not supported; convert it to {}",
                VERSIONS[VERSIONS.len() - 1]
            )));
        }
        Some(_) => {}
    }
    let text = root.attribute("timeStepSize").unwrap_or("missing");
    let dt = real(text).unwrap_or(f64::NAN);
    if !(SMALLEST_DT..=LARGEST_DT).contains(&dt) {
        let (shown, least, most) =
            (text.chars().take(30).collect::<String>(), general(SMALLEST_DT), general(LARGEST_DT));
        return Err(Refusal::of(format!(
            "the time step size (dt) is {shown}; it must be between {least} and {most} seconds"
        )));
    }
    if root.first("lanelet").is_none() {
        return Err(Refusal::of("has no lanelets; a scenario needs a road network"));
    }
    Ok(dt)
}

fn check_ids(root: Element<'_>) -> Read<()> {
    for (name, tags) in
        [("lanelets", &["lanelet"][..]), ("obstacles", &OBSTACLES[..]), ("planning problems", &["planningProblem"][..])]
    {
        let mut seen = BTreeSet::new();
        for element in tags.iter().flat_map(|tag| root.all(tag)) {
            let text = element.attribute("id").unwrap_or("missing");
            let Some(number) = whole(text) else {
                let tag = element.tag_name().name();
                return Err(Refusal::of(format!("a <{tag}> has the id '{text}'; it must be a whole number")));
            };
            if !seen.insert(number) {
                return Err(Refusal::of(format!("two {name} have the id {number}; give each its own")));
            }
        }
    }
    Ok(())
}

/// Refuses lanelets whose neighbours form a circle where signs or lights are placed by the outermost one.
fn check_adjacency(root: Element<'_>) -> Read<()> {
    let placed = |tag: &str| root.all(tag).all(|element| element.first("position").is_some());
    if placed("trafficSign") && placed("trafficLight") {
        return Ok(());
    }
    for side in ["adjacentLeft", "adjacentRight"] {
        let mut beside = BTreeMap::new();
        let mut starts = Vec::new();
        for lanelet in root.all("lanelet") {
            let Some(neighbour) = lanelet.first(side) else { continue };
            if neighbour.attribute("drivingDir") == Some("same") {
                let to = neighbour.attribute("ref").and_then(whole).unwrap_or(-1);
                beside.insert(i128::from(id(lanelet)?), to);
                starts.push(i128::from(id(lanelet)?));
            }
        }
        let mut done = BTreeSet::new();
        for start in starts {
            let mut way = BTreeSet::new();
            let mut at = start;
            while let Some(next) = beside.get(&at).filter(|_| !done.contains(&at)) {
                if !way.insert(at) {
                    return Err(Refusal::of(format!(
                        "lanelet {at} is its own neighbour: {side} leads back to it; correct the neighbours or give signs \
                         and lights a position"
                    )));
                }
                at = *next;
            }
            done.append(&mut way);
        }
    }
    Ok(())
}

fn check_points(lanelet: Element<'_>) -> Read<()> {
    let count = |side: &str| lanelet.path(&format!("{side}/point")).len();
    let (left, right) = (count("leftBound"), count("rightBound"));
    let number = lanelet.attribute("id").unwrap_or("None");
    if left != right || left < 2 {
        return Err(Refusal::of(format!(
            "lanelet {number} has {left} points on its left bound and {right} on its right one; give both the same number, \
             at least 2"
        )));
    }
    for line in lanelet.all("stopLine") {
        let n = line.all("point").count();
        if n != 0 && n != 2 {
            let points = if n == 1 { "point" } else { "points" };
            return Err(Refusal::of(format!(
                "the stop line of lanelet {number} has {n} {points}; give it both ends, or none for the lanelet's end"
            )));
        }
    }
    Ok(())
}
