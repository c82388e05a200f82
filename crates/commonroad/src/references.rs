//! References of a map to elements that do not exist.

use std::collections::BTreeSet;

use crate::tree::{Element, Tree};
use crate::values::whole;

/// This many of each kind are named.
const NAMED: usize = 3;
/// Targets of the relations of a lanelet, by their names in the format.
const RELATIONS: [(&str, &str); 6] = [
    ("predecessor", "predecessor"),
    ("successor", "successor"),
    ("left neighbour", "adjacentLeft"),
    ("right neighbour", "adjacentRight"),
    ("traffic light", "trafficLightRef"),
    ("traffic sign", "trafficSignRef"),
];
/// The same of an incoming element.
const WAYS: [&str; 4] = ["incomingLanelet", "successorsRight", "successorsStraight", "successorsLeft"];

/// Ids of the elements that something may refer to.
struct Known {
    lanelets: BTreeSet<i128>,
    lights: BTreeSet<i128>,
    signs: BTreeSet<i128>,
    incomings: BTreeSet<i128>,
}

impl Known {
    fn of(root: Element<'_>) -> Self {
        let ids =
            |name: &str| root.path(name).into_iter().filter_map(|one| one.attribute("id").and_then(whole)).collect();
        Self {
            lanelets: ids("lanelet"),
            lights: ids("trafficLight"),
            signs: ids("trafficSign"),
            incomings: ids("intersection/incoming"),
        }
    }

    fn has(&self, target: &str, number: i128) -> bool {
        match target {
            "traffic light" => self.lights.contains(&number),
            "traffic sign" => self.signs.contains(&number),
            "incoming" => self.incomings.contains(&number),
            _ => self.lanelets.contains(&number),
        }
    }
}

/// Collects the dangling references to each kind of target, in the order in which the kinds are found.
#[derive(Default)]
struct Dangling {
    by_target: Vec<(&'static str, Vec<String>)>,
}

impl Dangling {
    fn look<'a>(&mut self, known: &Known, owner: &str, target: &'static str, from: impl Iterator<Item = Element<'a>>) {
        for element in from {
            let Some(number) = element.attribute("ref").and_then(whole) else { continue };
            if known.has(target, number) {
                continue;
            }
            let at = self.by_target.iter().position(|(name, _)| *name == target).unwrap_or_else(|| {
                self.by_target.push((target, Vec::new()));
                self.by_target.len() - 1
            });
            self.by_target[at].1.push(format!("{owner} refers to {target} {number}, which does not exist"));
        }
    }
}

/// A line for each of the first three dangling references to a kind of element, and a line that counts the rest.
pub fn dangling(root: Element<'_>) -> Vec<String> {
    let known = Known::of(root);
    let mut found = Dangling::default();
    for lanelet in root.all("lanelet") {
        let name = format!("lanelet {}", lanelet.attribute("id").unwrap_or("None"));
        for (target, tag) in RELATIONS {
            found.look(&known, &name, target, lanelet.all(tag));
            if tag.starts_with("traffic") {
                let of_lines = lanelet.path(&format!("stopLine/{tag}"));
                found.look(&known, &format!("the stop line of {name}"), target, of_lines.into_iter());
            }
        }
    }
    for intersection in root.all("intersection") {
        let place = format!("of intersection {}", intersection.attribute("id").unwrap_or("None"));
        for incoming in intersection.all("incoming") {
            let name = format!("incoming {} {place}", incoming.attribute("id").unwrap_or("None"));
            for tag in WAYS {
                found.look(&known, &name, "lanelet", incoming.all(tag));
            }
            found.look(&known, &name, "incoming", incoming.all("isLeftOf"));
        }
        let crossed = intersection.path("crossing/crossingLanelet");
        found.look(&known, &format!("a crossing {place}"), "lanelet", crossed.into_iter());
    }
    let mut lines = Vec::new();
    for (target, texts) in found.by_target {
        lines.extend(texts.iter().take(NAMED).cloned());
        if texts.len() > NAMED {
            lines.push(format!("{} more references to a {target} that does not exist", texts.len() - NAMED));
        }
    }
    lines
}
