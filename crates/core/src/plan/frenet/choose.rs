//! Lazy best-first choice: the smallest (cost, index), with as few evaluations as the bounds allow.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A lower bound of a sample's cost. Ordered by (bound, index), a total order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Entry {
    bound: f64,
    index: u32,
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.bound.total_cmp(&other.bound).then(self.index.cmp(&other.index))
    }
}

/// What one more step of work on a sample found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Refined {
    /// It is not admissible.
    Rejected,
    /// Its cost is at least this; there is more to do.
    Bound(f64),
    /// Its cost.
    Cost(f64),
}

/// Memory of `best_first`.
pub(super) type Heap = BinaryHeap<Reverse<Entry>>;

/// The admissible sample with the smallest (cost, index) and its cost. `bounds` are lower bounds of the costs, infinite
/// for samples that are rejected already; each call of `refine` does one more step of work and never returns less than
/// before.
///
/// A sample is only returned when it is complete and everybody else's (bound, index) is larger. As no cost is below its
/// bound, the result is that of `exhaustive`.
pub(super) fn best_first(
    bounds: impl Iterator<Item = f64>,
    heap: &mut Heap,
    mut refine: impl FnMut(usize) -> Refined,
) -> Option<(usize, f64)> {
    let mut entries = std::mem::take(heap).into_vec();
    entries.clear();
    let finite = bounds.enumerate().filter(|(_, bound)| bound.is_finite());
    entries.extend(finite.map(|(index, bound)| Reverse(Entry { bound, index: index as u32 })));
    *heap = BinaryHeap::from(entries);
    while let Some(Reverse(mut entry)) = heap.pop() {
        let index = entry.index as usize;
        loop {
            match refine(index) {
                Refined::Rejected => break,
                Refined::Bound(bound) => entry.bound = bound,
                Refined::Cost(cost) => {
                    entry.bound = cost;
                    if heap.peek().is_none_or(|Reverse(next)| entry < *next) {
                        return Some((index, cost));
                    }
                }
            }
            if heap.peek().is_some_and(|Reverse(next)| *next < entry) {
                heap.push(Reverse(entry));
                break;
            }
        }
    }
    None
}

/// The same by evaluating every sample to its end.
pub(super) fn exhaustive(
    bounds: impl Iterator<Item = f64>,
    mut refine: impl FnMut(usize) -> Refined,
) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    for (index, bound) in bounds.enumerate() {
        if !bound.is_finite() {
            continue;
        }
        let cost = loop {
            match refine(index) {
                Refined::Rejected => break None,
                Refined::Bound(_) => {}
                Refined::Cost(cost) => break Some(cost),
            }
        };
        best = match (best, cost) {
            (Some(best), Some(cost)) if cost.total_cmp(&best.1).is_lt() => Some((index, cost)),
            (None, Some(cost)) => Some((index, cost)),
            (best, _) => best,
        };
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;

    #[test]
    fn best_first_returns_the_exhaustive_choice_with_less_work() {
        let mut random = Lcg::new(3);
        let mut heap = Heap::new();
        let (mut lazy_work, mut full_work) = (0, 0);
        for _ in 0..200 {
            // Costs as sums of five parts on a coarse grid, so that ties happen; a quarter is rejected.
            let n = 100;
            let part = |random: &mut Lcg| random.within(0.0, 3.0).floor();
            let parts: Vec<[f64; 5]> = (0..n).map(|_| std::array::from_fn(|_| part(&mut random))).collect();
            let rejected: Vec<bool> = (0..n).map(|_| random.within(0.0, 1.0) < 0.25).collect();
            let step = |done: &mut Vec<usize>, work: &mut usize, i: usize| {
                *work += 1;
                if rejected[i] {
                    return Refined::Rejected;
                }
                done[i] = (done[i] + 1).min(4);
                let sum = parts[i][..=done[i]].iter().sum();
                if done[i] == 4 { Refined::Cost(sum) } else { Refined::Bound(sum) }
            };
            let bounds = || parts.iter().map(|p| p[0]);
            let (mut a, mut b) = (vec![0; n], vec![0; n]);
            let lazy = best_first(bounds(), &mut heap, |i| step(&mut a, &mut lazy_work, i));
            let full = exhaustive(bounds(), |i| step(&mut b, &mut full_work, i));
            assert_eq!(lazy, full);
        }
        assert!(3 * lazy_work < full_work, "{lazy_work} of {full_work}");
    }

    #[test]
    fn nobody_is_chosen_if_all_are_rejected() {
        let bounds = || [1.0, f64::INFINITY].into_iter();
        assert_eq!(best_first(bounds(), &mut Heap::new(), |_| Refined::Rejected), None);
        assert_eq!(exhaustive(bounds(), |_| Refined::Rejected), None);
    }
}
