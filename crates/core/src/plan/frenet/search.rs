//! Lazy best-first choice: the smallest (cost, index), with as few evaluations as the bounds allow.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A lower bound of the cost of a sample, or of all samples of a group. Ordered by (bound, index), a total order: one
/// number holds both, so that entries are compared quickly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Entry(
    /// The bound, so that larger ones have larger bits; the index of the sample, or of the group's first sample; the
    /// number of the group plus 1, or 0.
    u128,
);

impl Entry {
    pub(super) fn sample(bound: f64, index: usize) -> Self {
        Self::new(bound, index as u32, 0)
    }

    /// A group whose first sample is `first`; the others follow it.
    pub(super) fn group(bound: f64, first: usize, group: usize) -> Self {
        Self::new(bound, first as u32, group as u32 + 1)
    }

    #[inline]
    fn new(bound: f64, index: u32, group: u32) -> Self {
        let bits = reordered(bound.to_bits()) ^ (1 << 63);
        Self(u128::from(bits) << 64 | u128::from(index) << 32 | u128::from(group))
    }

    #[inline]
    fn bound(self) -> f64 {
        f64::from_bits(reordered((self.0 >> 64) as u64 ^ (1 << 63)))
    }

    #[inline]
    fn index(self) -> usize {
        (self.0 >> 32) as u32 as usize
    }

    #[inline]
    fn group_number(self) -> Option<usize> {
        (self.0 as u32 as usize).checked_sub(1)
    }

    /// The same with another bound.
    #[inline]
    fn with(self, bound: f64) -> Self {
        Self::new(bound, self.index() as u32, self.0 as u32)
    }
}

/// Bits of numbers in the order of `f64::total_cmp` as signed integers, and back.
#[inline]
fn reordered(bits: u64) -> u64 {
    bits ^ (((bits as i64 >> 63) as u64) >> 1)
}

/// The result of one more step of work on a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Refined {
    /// It is not admissible.
    Rejected,
    /// Its cost is at least this; there is more to do.
    Bound(f64),
    /// Its cost.
    Cost(f64),
}

/// Access to the samples.
pub(super) trait SearchSpace {
    /// Bounds of the samples of a group, in order; none is below that of the group, infinite ones are rejected already.
    fn open(&mut self, group: usize) -> impl Iterator<Item = f64>;

    /// One more step of work on a sample; never returns less than before.
    fn refine(&mut self, sample: usize) -> Refined;
}

/// What is still to be examined, the smallest entry first.
pub(super) type Queue = BinaryHeap<Reverse<Entry>>;

/// Begins a search anew.
pub(super) fn start(queue: &mut Queue, entries: impl Iterator<Item = Entry>) {
    let mut memory = std::mem::take(queue).into_vec();
    memory.clear();
    memory.extend(entries.filter(|entry| entry.bound() < f64::INFINITY).map(Reverse));
    *queue = BinaryHeap::from(memory);
}

/// The admissible sample with the smallest (cost, index) and its cost. What the queue was started with are lower bounds
/// of the costs, infinite for rejected samples.
///
/// A sample is only returned when it is complete and the (bound, index) of all others is larger. As no cost is below its
/// bound, the result is that of `exhaustive`.
pub(super) fn best_first(queue: &mut Queue, search: &mut impl SearchSpace) -> Option<(usize, f64)> {
    while let Some(Reverse(mut entry)) = queue.pop() {
        let index = entry.index();
        if let Some(group) = entry.group_number() {
            let samples = search.open(group).enumerate().filter(|(_, bound)| bound.is_finite());
            queue.extend(samples.map(|(i, bound)| Reverse(Entry::sample(bound, index + i))));
            continue;
        }
        loop {
            match search.refine(index) {
                Refined::Rejected => break,
                Refined::Bound(bound) => entry = entry.with(bound),
                Refined::Cost(cost) => {
                    entry = entry.with(cost);
                    if queue.peek().is_none_or(|Reverse(next)| entry < *next) {
                        return Some((index, cost));
                    }
                }
            }
            if queue.peek().is_some_and(|Reverse(next)| *next < entry) {
                queue.push(Reverse(entry));
                break;
            }
        }
    }
    None
}

/// The same by evaluating every sample to its end.
pub(super) fn exhaustive(queue: &Queue, search: &mut impl SearchSpace) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    let mut entries: Vec<Entry> = queue.iter().map(|Reverse(entry)| *entry).collect();
    entries.sort_unstable_by_key(|entry| entry.index());
    for entry in entries {
        let (bound, index, group) = (entry.bound(), entry.index(), entry.group_number());
        let bounds: Vec<f64> = group.map_or_else(|| vec![bound], |group| search.open(group).collect());
        for sample in (0..bounds.len()).filter(|i| bounds[*i].is_finite()).map(|i| index + i) {
            let cost = loop {
                match search.refine(sample) {
                    Refined::Rejected => break None,
                    Refined::Bound(_) => {}
                    Refined::Cost(cost) => break Some(cost),
                }
            };
            best = match (best, cost) {
                (Some(best), Some(cost)) if cost.total_cmp(&best.1).is_lt() => Some((sample, cost)),
                (None, Some(cost)) => Some((sample, cost)),
                (best, _) => best,
            };
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;

    const GROUP: usize = 10;

    /// Costs as sums of five parts, which become known one by one.
    struct Sums<'a> {
        parts: &'a [[f64; 5]],
        rejected: &'a [bool],
        done: Vec<usize>,
        work: usize,
    }

    impl SearchSpace for Sums<'_> {
        fn open(&mut self, group: usize) -> impl Iterator<Item = f64> {
            self.work += 1;
            self.parts[group * GROUP..(group + 1) * GROUP].iter().map(|parts| parts[0])
        }

        fn refine(&mut self, i: usize) -> Refined {
            self.work += 1;
            if self.rejected[i] {
                return Refined::Rejected;
            }
            self.done[i] = (self.done[i] + 1).min(4);
            let sum = self.parts[i][..=self.done[i]].iter().sum();
            if self.done[i] == 4 { Refined::Cost(sum) } else { Refined::Bound(sum) }
        }
    }

    #[test]
    fn best_first_returns_the_exhaustive_choice_with_less_work() {
        let mut random = Lcg::new(3);
        let mut queue = Queue::default();
        let (mut lazy_work, mut full_work) = (0, 0);
        for _ in 0..200 {
            // On a coarse grid, so that ties happen; a quarter is rejected.
            let n = 100;
            let part = |random: &mut Lcg| random.within(0.0, 3.0).floor();
            let mut parts: Vec<[f64; 5]> = (0..n).map(|_| std::array::from_fn(|_| part(&mut random))).collect();
            // Some are rejected when their group is opened, in one group all.
            for i in (0..n).filter(|i| i % 17 == 0 || i / GROUP == 4) {
                parts[i][0] = f64::INFINITY;
            }
            let rejected: Vec<bool> = (0..n).map(|_| random.within(0.0, 1.0) < 0.25).collect();
            let least = |group: usize| {
                parts[group * GROUP..(group + 1) * GROUP].iter().map(|parts| parts[0]).fold(f64::INFINITY, f64::min)
            };
            // The last ten stand alone. Bounds of groups may be low.
            let groups = (0..9).map(|group| {
                let first = if least(group).is_finite() { least(group) } else { 1.0 };
                Entry::group(first - f64::from(u8::from(group.is_multiple_of(2))), group * GROUP, group)
            });
            let alone = (90..n).map(|i| Entry::sample(parts[i][0], i));
            start(&mut queue, groups.chain(alone));
            let search = || Sums { parts: &parts, rejected: &rejected, done: vec![0; n], work: 0 };
            let (mut lazy, mut full) = (search(), search());
            let chosen = exhaustive(&queue, &mut full);
            assert_eq!(best_first(&mut queue, &mut lazy), chosen);
            lazy_work += lazy.work;
            full_work += full.work;
        }
        assert!(3 * lazy_work < full_work, "{lazy_work} of {full_work}");
    }

    #[test]
    fn none_is_chosen_if_all_are_rejected() {
        let mut queue = Queue::default();
        start(&mut queue, [Entry::sample(1.0, 0), Entry::sample(f64::INFINITY, 1)].into_iter());
        let mut search = Sums { parts: &[[1.0; 5]; 2], rejected: &[true; 2], done: vec![0; 2], work: 0 };
        assert_eq!(exhaustive(&queue, &mut search), None);
        assert_eq!(best_first(&mut queue, &mut search), None);
    }
}
