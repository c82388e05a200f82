//! Planning problems.

use crate::document::{Position, Problem, Read, Refusal, State, Value};
use crate::states;
use crate::tree::{Element, Tree, id};

/// What a goal may state.
const CONDITIONS: [&str; 4] = ["orientation", "position", "time", "velocity"];

/// All planning problems.
pub fn problems(root: Element<'_>) -> Read<Vec<Problem>> {
    root.all("planningProblem").map(problem).collect()
}

fn problem(element: Element<'_>) -> Read<Problem> {
    let number = id(element)?;
    let start = element.need("initialState")?;
    if start.all("orientation").any(states::is_any_heading) {
        return Err(Refusal::of(format!("planning problem {number} starts with any heading; state one")));
    }
    Ok(Problem {
        id: number,
        initial: states::initial(start, &format!("planning problem {number}"))?,
        goals: element.all("goalState").map(|state| goal(state, number)).collect::<Read<_>>()?,
    })
}

fn goal(element: Element<'_>, number: i64) -> Read<(State, Vec<i64>)> {
    let mut lanelets = Vec::new();
    let (state, names) = states::later(element, Some(&mut lanelets))?;
    if let Some(other) = names.iter().find(|name| !CONDITIONS.contains(&name.as_str())) {
        return Err(element.refused(&format!("a goal has no condition on <{other}>")));
    }
    if matches!(state.position, Some(Position::Point(_))) {
        return Err(Refusal::of(format!(
            "the goal of planning problem {number} is a point, which no vehicle can reach; give an area"
        )));
    }
    let is_exact =
        matches!(state.velocity, Some(Value::Exact(_))) || matches!(state.orientation, Some(Value::Exact(_)));
    if is_exact || !matches!(state.time_step, Some(Value::Interval(..))) {
        return Err(element.refused("time, velocity and orientation of a goal must be intervals"));
    }
    Ok((state, lanelets))
}
