//! A document as a whole.

use std::collections::BTreeSet;

use roxmltree::ParsingOptions;

use crate::control;
use crate::document::{Document, Obstacle, Read, Refusal, Role, Sign, SignElement};
use crate::names::country;
use crate::problems::problems;
use crate::references::dangling;
use crate::roads;
use crate::structure;
use crate::traffic::obstacles;
use crate::tree::{Element, Tree, id};

/// Benchmark id of documents that state none.
const UNNAMED: &str = "ZAM_Unnamed-1_1_T-1";
/// Signs made of speed limits have ids beyond the largest one by this much.
const ID_GAP: i64 = 10_000;

/// Reads a document.
///
/// # Errors
///
/// [`Refusal`] if it is not well-formed, declares a document type, or cannot become a scenario.
pub fn read(text: &str) -> Read<Document> {
    let options = ParsingOptions { allow_dtd: false, ..ParsingOptions::default() };
    let parsed =
        roxmltree::Document::parse_with_options(text, options).map_err(|error| Refusal::Syntax(error.to_string()))?;
    let root = parsed.root_element();
    let dt = structure::check(root)?;
    let mut notes = dangling(root);
    let version = root.attribute("commonRoadVersion").unwrap_or_default();
    let benchmark_id = root.attribute("benchmarkID").filter(|id| !id.is_empty()).unwrap_or(UNNAMED);
    let obstacles = obstacles(root, version)?;
    let mut lanelets = roads::lanelets(root)?;
    let mut signs = control::signs(root, &lanelets, country(benchmark_id), &mut notes)?;
    let lights = control::lights(root, &lanelets, &mut notes)?;
    let intersections = control::intersections(root, &mut notes)?;
    let of_map =
        lanelets.iter().map(|one| one.id).chain(signs.iter().map(|one| one.id)).chain(lights.iter().map(|one| one.id));
    let of_map = of_map.chain(
        intersections
            .iter()
            .flat_map(|one| std::iter::once(one.id).chain(one.incomings.iter().map(|incoming| incoming.id))),
    );
    let mut taken = distinct(of_map.chain(obstacles.iter().map(|one| one.id)))?;
    if version == "2018b" {
        for (sign, lanelet) in signs_of_limits(root, &mut taken)? {
            if let Some(row) = lanelets.iter().position(|one| one.id == lanelet) {
                lanelets[row].signs.push(sign.id);
            }
            signs.push(sign);
        }
    }
    let mut obstacles = obstacles;
    obstacles.sort_by_key(order);
    Ok(Document {
        dt,
        benchmark_id: benchmark_id.to_string(),
        version: version.to_string(),
        problems: problems(root)?,
        lanelets,
        signs,
        lights,
        intersections,
        obstacles,
        notes,
    })
}

fn order(obstacle: &Obstacle) -> u8 {
    match obstacle.role {
        Role::Static => 0,
        Role::Dynamic => 1,
        Role::Environment => 2,
        Role::Phantom => 3,
    }
}

/// Ids of map and traffic, which share one set.
fn distinct(ids: impl Iterator<Item = i64>) -> Read<BTreeSet<i64>> {
    let mut taken = BTreeSet::new();
    for number in ids {
        if !taken.insert(number) {
            return Err(Refusal::of(format!("ID {number} is already used; give each lanelet and obstacle its own")));
        }
    }
    Ok(taken)
}

/// A sign for each lanelet with a speed limit of the version 2018b, by limits in the order of their first lanelets.
fn signs_of_limits(root: Element<'_>, taken: &mut BTreeSet<i64>) -> Read<Vec<(Sign, i64)>> {
    let mut by_limit: Vec<(f64, BTreeSet<i64>)> = Vec::new();
    for lanelet in root.all("lanelet") {
        let Some(limit) = roads::speed_limit(lanelet)? else { continue };
        match by_limit.iter_mut().find(|(other, _)| *other == limit) {
            Some((_, lanelets)) => drop(lanelets.insert(id(lanelet)?)),
            None => by_limit.push((limit, BTreeSet::from([id(lanelet)?]))),
        }
    }
    let mut signs = Vec::new();
    for (limit, lanelets) in by_limit {
        for lanelet in lanelets {
            let number = taken.last().copied().unwrap_or(0) + 1 + ID_GAP;
            taken.insert(number);
            let value = Some(format!("{limit:?}"));
            let elements = vec![SignElement { name: "MAX_SPEED", code: String::new(), value }];
            signs.push((Sign { id: number, elements }, lanelet));
        }
    }
    Ok(signs)
}
