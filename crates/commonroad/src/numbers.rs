//! Bounds of all numbers of a document, checked before anything else is made of it.
//!
//! Text that is not a number is left to what reads the element, which names it.

use crate::document::{Read, Refusal};
use crate::limits;
use crate::tree::{Element, Tree};
use crate::values::{general, real, shown, whole};

/// Range in which arithmetic of values without a bound of their own stays finite.
const OTHER_VALUES: f64 = 1e12;

/// Refuses ids, time steps and values out of bounds, and documents that are too deep or too large.
pub fn check(root: Element<'_>) -> Read<()> {
    check_depth(root)?;
    check_counts(root)?;
    for owner in root.elements() {
        let start = owner.first("initialState").and_then(|initial| initial.first("time"));
        for element in owner.descendants().filter(|node| node.is_element()) {
            check_ids(element, owner)?;
            if element.has_children() && element.elements().next().is_some() {
                for child in element.elements() {
                    if matches!(child.tag_name().name(), "exact" | "intervalStart" | "intervalEnd") {
                        check_exact_or_interval(child, element, owner, start == Some(element))?;
                    }
                }
            } else if let Some(most) = bound(element.tag_name().name()) {
                check_value(element, most, owner, element.tag_name().name())?;
            }
        }
    }
    Ok(())
}

/// Largest absolute value of an element without children.
fn bound(name: &str) -> Option<f64> {
    match name {
        "x" | "y" | "z" | "length" | "width" | "radius" | "originXShift" | "speedLimit" | "duration" | "timeOffset" => {
            Some(limits::LARGEST_COORDINATE)
        }
        "geoNameId" => Some(limits::LARGEST_ID as f64),
        "xTranslation" | "yTranslation" | "zRotation" | "scaling" => Some(f64::INFINITY),
        "orientation" => Some(limits::LARGEST_ANGLE),
        _ => None,
    }
}

/// Largest absolute value of what an element around it states exactly or as an interval.
fn bound_within(name: &str) -> f64 {
    match name {
        "orientation" => limits::LARGEST_ANGLE,
        "velocity" | "velocityY" => limits::LARGEST_VELOCITY,
        "acceleration" => limits::LARGEST_ACCELERATION,
        "yawRate" => limits::LARGEST_YAW_RATE,
        _ => OTHER_VALUES,
    }
}

fn check_depth(root: Element<'_>) -> Read<()> {
    // The walk goes down at most one element further than is allowed, so it needs no stack of its own.
    fn deeper(element: Element<'_>, depth: usize) -> Read<()> {
        if depth > limits::DEEPEST {
            let (name, most) = (crate::tree::full_name(element), limits::DEEPEST);
            return Err(Refusal::of(format!(
                "<{name}> is nested more than {most} elements deep; is the file damaged?"
            )));
        }
        element.elements().try_for_each(|child| deeper(child, depth + 1))
    }
    deeper(root, 1)
}

fn require_count(n: usize, most: usize, counted: &str, what: &str) -> Read<()> {
    let advice = match counted {
        "points on a bound" => "thin them out or split it",
        "planning problems" => "split it",
        _ => "cut it",
    };
    if n <= most {
        return Ok(());
    }
    Err(Refusal::of(format!("{what} has {n} {counted}; at most {most} are possible, {advice}")))
}

/// Counts that would cost much time before the arrays exist.
fn check_counts(root: Element<'_>) -> Read<()> {
    let points = |lanelet: Element<'_>| lanelet.elements().map(|side| side.all("point").count()).sum::<usize>();
    let states = |owner: Element<'_>| owner.path("trajectory/state").len();
    require_count(root.all("lanelet").count(), limits::MOST_LANELETS, "lanelets", "the map")?;
    require_count(root.all("lanelet").map(points).sum(), limits::MOST_POINTS, "points", "the map")?;
    let n_problems = root.all("planningProblem").count();
    require_count(n_problems, limits::MOST_PROBLEMS, "planning problems", "the scenario")?;
    for name in ["dynamicObstacle", "staticObstacle", "obstacle"] {
        require_count(root.all(name).count(), limits::MOST_OBSTACLES, "obstacles", "the scenario")?;
    }
    require_count(root.elements().map(states).sum(), limits::MOST_STATES, "states", "the recording")?;
    for lanelet in root.all("lanelet") {
        for bound in ["leftBound", "rightBound"] {
            let n = lanelet.all(bound).map(|side| side.all("point").count()).sum();
            require_count(n, limits::MOST_POINTS_OF_A_LANELET, "points on a bound", &lanelet.named())?;
        }
    }
    Ok(())
}

fn check_ids(element: Element<'_>, owner: Element<'_>) -> Read<()> {
    let name = crate::tree::full_name(element);
    for attribute in ["id", "ref", "outgoingId"] {
        let Some(text) = element.attribute(attribute) else { continue };
        let is_owner = element == owner;
        let Some(number) = whole(text) else {
            let place = if is_owner { format!("a <{name}>") } else { format!("a <{name}> of {}", owner.named()) };
            let short: String = text.chars().take(30).collect();
            return Err(Refusal::of(format!("{place} has the {attribute} '{short}'; it must be a whole number")));
        };
        if !(0..=i128::from(limits::LARGEST_ID)).contains(&number) {
            let place = if is_owner { format!("a <{name}>") } else { format!("<{name}> of {}", owner.named()) };
            let (shown, most) = (shown(number), limits::LARGEST_ID);
            return Err(Refusal::of(format!("{place} has the id {shown}; ids must be between 0 and {most}")));
        }
    }
    Ok(())
}

/// Checks the exact value or both ends of the interval in an element.
fn check_exact_or_interval(value: Element<'_>, around: Element<'_>, owner: Element<'_>, is_start: bool) -> Read<()> {
    let name = around.tag_name().name();
    if name == "time" {
        check_time(value, owner, is_start)
    } else {
        check_value(value, bound_within(name), owner, name)
    }
}

fn check_time(element: Element<'_>, owner: Element<'_>, is_start: bool) -> Read<()> {
    let text = element.words();
    let Some(time_step) = whole(if text.is_empty() { "0" } else { &text }) else {
        return check_value(element, limits::LARGEST_TIME_STEP as f64, owner, "time");
    };
    let is_goal = owner.is("planningProblem") && !is_start;
    let last = if is_goal { limits::LARGEST_GOAL_TIME_STEP } else { limits::LARGEST_TIME_STEP };
    if (0..=i128::from(last)).contains(&time_step) {
        return Ok(());
    }
    let (what, shown) = (owner.named(), shown(time_step));
    Err(Refusal::of(if time_step < 0 {
        format!("{what} has the time step {shown}; time steps start at 0")
    } else {
        format!("{what} has the time step {shown}, the largest possible one is {last}; is that a typing error?")
    }))
}

fn check_value(element: Element<'_>, most: f64, owner: Element<'_>, within: &str) -> Read<()> {
    let text = element.words();
    let Some(value) = real(if text.is_empty() { "0" } else { &text }) else { return Ok(()) };
    if value.is_finite() && value.abs() <= most {
        return Ok(());
    }
    let what = owner.named();
    if most == limits::LARGEST_ANGLE && value.is_finite() {
        return Err(Refusal::of(format!("{what} has the orientation {}; give it in radians", general(value))));
    }
    let wanted = if value.is_finite() {
        format!("between {} and {}", general(-most), general(most))
    } else {
        "a finite number".to_string()
    };
    let short: String = text.trim().chars().take(30).collect();
    Err(Refusal::of(format!("{what} has the value {short} in <{within}>; it must be {wanted}")))
}
