//! One total order of claims: that of the rules of the road where they give one, otherwise by arrival.

use crate::v2x::message::Claim;

/// A junction area on the way of an agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossing {
    /// Number of the area, and the agent's side of it (0 or 1).
    pub(crate) area: usize,
    pub(crate) side: usize,
    /// Arc lengths on the agent's path [m].
    pub(crate) entry: f64,
    pub(crate) exit: f64,
}

/// An agent with a claim, as another one knows of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Claimant<'a> {
    pub(super) id: i64,
    pub(super) claim: Claim,
    /// Areas and sides of its way, ascending.
    pub(super) areas: &'a [(usize, usize)],
    /// Ids of the agents that it lets go first.
    pub(super) yields_to: &'a [i64],
    /// Ids of the agents before whose ways it can no longer stop.
    pub(super) passes: &'a [i64],
}

/// By arrival, then by id.
fn key(one: &Claimant<'_>) -> (i64, i64) {
    (one.claim.arrival, one.id)
}

/// Areas that two ways have in common, with the sides of both.
pub(super) fn common<'a>(
    a: &'a [(usize, usize)],
    b: &'a [(usize, usize)],
) -> impl Iterator<Item = (usize, usize, usize)> + 'a {
    a.iter().filter_map(|(area, side)| {
        let found = b.binary_search_by_key(area, |(area, _)| *area).ok()?;
        Some((*area, *side, b[found].1))
    })
}

/// Whether `a` goes before `b`, as far as the two alone decide: what they agreed on, then the rules of the road. `first`
/// is the side of an area that goes first by the rules, if they say so.
fn goes_before(a: &Claimant<'_>, b: &Claimant<'_>, first: &[Option<usize>]) -> Option<bool> {
    let passes = (a.passes.contains(&b.id), b.passes.contains(&a.id));
    if passes.0 || passes.1 {
        return (passes.0 != passes.1).then_some(passes.0);
    }
    let is_waived = a.claim.is_waived || b.claim.is_waived;
    let agreed = (b.yields_to.contains(&a.id), a.yields_to.contains(&b.id));
    if agreed.0 != agreed.1 && !is_waived {
        return Some(agreed.0);
    }
    let mut found = None;
    for (area, own, other) in common(a.areas, b.areas) {
        let says = match first[area] {
            // One is behind the other in the same lane.
            _ if own == other => key(a) < key(b),
            Some(_) if is_waived => continue,
            Some(side) => side == own,
            None => continue,
        };
        if found.is_some_and(|found| found != says) {
            return None;
        }
        found = Some(says);
    }
    found
}

/// Which of the agents go before the one at a position. Where pairs decide, they are followed; agents that would wait for
/// each other in a circle, and those about which nothing says more, go by arrival.
pub(super) fn before(all: &[Claimant<'_>], me: usize, first: &[Option<usize>]) -> Vec<bool> {
    let n = all.len();
    let mut ahead: Vec<Vec<usize>> = vec![Vec::new(); n];
    for i in 0..n {
        for j in 0..i {
            match goes_before(&all[i], &all[j], first) {
                Some(true) => ahead[j].push(i),
                Some(false) => ahead[i].push(j),
                None => {}
            }
        }
    }
    let mut gone = vec![false; n];
    while !gone[me] {
        let left = (0..n).filter(|i| !gone[*i]);
        let is_free = |i: &usize| ahead[*i].iter().all(|j| gone[*j]);
        let next = left.clone().filter(is_free).min_by_key(|i| key(&all[*i]));
        let mut together = match next {
            Some(next) => vec![next],
            None => circle(left.min_by_key(|i| key(&all[*i])).expect("one is left"), &ahead, &gone),
        };
        together.sort_by_key(|i| key(&all[*i]));
        for i in together {
            if i == me {
                return gone;
            }
            gone[i] = true;
        }
    }
    gone
}

/// A circle of agents that wait for each other and for no others, among those for which one waits.
fn circle(mut from: usize, ahead: &[Vec<usize>], gone: &[bool]) -> Vec<usize> {
    let awaited = |from: usize| {
        let (mut found, mut open) = (vec![false; gone.len()], vec![from]);
        while let Some(i) = open.pop() {
            for &j in ahead[i].iter().filter(|j| !gone[**j]) {
                if !std::mem::replace(&mut found[j], true) {
                    open.push(j);
                }
            }
        }
        found
    };
    let mut found = awaited(from);
    // Every step leads to one that waits for fewer.
    while let Some(next) = (0..gone.len()).find(|i| found[*i] && !awaited(*i)[from]) {
        from = next;
        found = awaited(from);
    }
    (0..gone.len()).filter(|i| found[*i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claimant<'a>(id: i64, arrival: i64, areas: &'a [(usize, usize)]) -> Claimant<'a> {
        let claim = Claim { n: 1, arrival, is_waived: false };
        Claimant { id, claim, areas, yields_to: &[], passes: &[] }
    }

    /// Ids in the order that all of them compute.
    fn order(all: &[Claimant<'_>], first: &[Option<usize>]) -> Vec<i64> {
        let place = |me: usize| before(all, me, first).iter().filter(|is| **is).count();
        let mut ids: Vec<(usize, i64)> = (0..all.len()).map(|me| (place(me), all[me].id)).collect();
        ids.sort_unstable();
        assert!(ids.iter().enumerate().all(|(i, (place, _))| i == *place), "it is total: {ids:?}");
        ids.into_iter().map(|(_, id)| id).collect()
    }

    #[test]
    fn a_side_road_waits_although_it_arrives_first() {
        let (main, side) = ([(0, 0)], [(0, 1)]);
        assert_eq!(order(&[claimant(1, 50, &main), claimant(2, 10, &side)], &[Some(0)]), [1, 2]);
        assert_eq!(order(&[claimant(1, 50, &main), claimant(2, 10, &side)], &[None]), [2, 1]);
    }

    #[test]
    fn agents_that_cannot_stop_or_do_not_use_their_right_are_exceptions() {
        let (main, side) = ([(0, 0)], [(0, 1)]);
        let [mut one, mut two] = [claimant(1, 50, &main), claimant(2, 10, &side)];
        one.claim.is_waived = true;
        assert_eq!(order(&[one, two], &[Some(0)]), [2, 1]);
        one.claim.is_waived = false;
        two.passes = &[1];
        assert_eq!(order(&[one, two], &[Some(0)]), [2, 1]);
    }

    #[test]
    fn in_a_circle_arrival_decides_and_what_was_agreed_stays() {
        // Priority to the right at four arms: each of 1, 2, 3, 4 waits for the next one. One on a side road waits for 1.
        let areas = [[(0, 1), (3, 0)], [(0, 0), (1, 1)], [(1, 0), (2, 1)], [(2, 0), (3, 1)]];
        let first = [Some(0), Some(0), Some(0), Some(0), Some(0)];
        let of_one = [(0, 1), (3, 0), (4, 0)];
        let side = [(4, 1)];
        let mut all = vec![claimant(1, 20, &of_one)];
        all.extend((1..4).map(|i| claimant(i as i64 + 1, 20, &areas[i])));
        all.push(claimant(9, 0, &side));
        assert_eq!(order(&all, &first), [1, 2, 3, 4, 9]);
        let mut left = all.split_off(1);
        assert_eq!(order(&left[..3], &first), [4, 3, 2], "without an agreement");
        (left[1].yields_to, left[2].yields_to) = (&[2], &[3]);
        assert_eq!(order(&left[..3], &first), [2, 3, 4]);
    }
}
