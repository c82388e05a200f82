//! Things with a place and a time, sorted by time, so that those of one time are looked at together.

/// Things of one time are filled up to a multiple of this by things whose numbers are none, so that no comparison holds.
pub(super) const GROUP: usize = 8;

/// Things with `N` numbers each, in single precision; they are numbered in the order in which they were added. The
/// memory is reused.
#[derive(Debug, Clone)]
pub(super) struct ByTime<const N: usize> {
    /// Before sorting.
    added: Vec<(usize, [f32; N])>,
    /// Those of time `i` are at `starts[i]..starts[i + 1]`, with filling.
    starts: Vec<usize>,
    /// How many there are of each time.
    counts: Vec<usize>,
    order: Vec<usize>,
    columns: [Vec<f32>; N],
}

impl<const N: usize> Default for ByTime<N> {
    fn default() -> Self {
        Self {
            added: Vec::new(),
            starts: Vec::new(),
            counts: Vec::new(),
            order: Vec::new(),
            columns: std::array::from_fn(|_| Vec::new()),
        }
    }
}

impl<const N: usize> ByTime<N> {
    pub(super) fn clear(&mut self) {
        self.added.clear();
    }

    /// One thing more.
    pub(super) fn push(&mut self, time: usize, numbers: [f32; N]) {
        self.added.push((time, numbers));
    }

    /// Sorts what was added; things of one time keep their order.
    pub(super) fn sort(&mut self, n_times: usize) {
        self.counts.clear();
        self.counts.resize(n_times, 0);
        for (time, _) in &self.added {
            self.counts[*time] += 1;
        }
        self.starts.clear();
        let mut n = 0;
        for count in &mut self.counts {
            self.starts.push(n);
            n += count.next_multiple_of(GROUP);
            *count = 0;
        }
        self.starts.push(n);
        for column in &mut self.columns {
            column.clear();
            column.resize(n, f32::NAN);
        }
        self.order.resize(n, 0);
        for (index, (time, numbers)) in self.added.iter().enumerate() {
            let to = self.starts[*time] + self.counts[*time];
            self.order[to] = index;
            for (column, number) in self.columns.iter_mut().zip(numbers) {
                column[to] = *number;
            }
            self.counts[*time] += 1;
        }
    }

    /// Numbers of the things of a time, in the order in which they were added.
    #[inline(always)]
    pub(super) fn of(&self, time: usize) -> &[usize] {
        &self.order[self.starts[time]..][..self.counts[time]]
    }

    /// Where the groups of a time are: the first one and where they end, in steps of `GROUP`.
    #[inline(always)]
    pub(super) fn groups(&self, time: usize) -> (usize, usize) {
        (self.starts[time], self.starts[time + 1])
    }

    /// Which things of a group pass a test, one bit each. The test answers 1 for yes and 0 for no, and 0 if the numbers
    /// are none. It is given the numbers of the group, column by column, and which of the group to test.
    #[expect(clippy::needless_range_loop, reason = "functions of iterators that are not inlined know no wide machines")]
    #[inline(always)]
    pub(super) fn passing(&self, group: usize, test: impl Fn(&[[f32; GROUP]; N], usize) -> u32) -> u32 {
        let mut numbers = [[0.0; GROUP]; N];
        for (numbers, column) in numbers.iter_mut().zip(&self.columns) {
            if let [a, b, c, d, e, f, g, h] = column[group..group + GROUP] {
                *numbers = [a, b, c, d, e, f, g, h];
            }
        }
        let mut bits = [0; GROUP];
        for k in 0..GROUP {
            bits[k] = test(&numbers, k).wrapping_neg() & 1 << k;
        }
        let mut passing = 0;
        for k in 0..GROUP {
            passing |= bits[k];
        }
        passing
    }

    /// Number of the first thing of a group among those of some bits, at least one.
    #[inline(always)]
    pub(super) fn number(&self, group: usize, bits: u32) -> usize {
        self.order[group + bits.trailing_zeros() as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_are_found_at_their_time_in_the_order_in_which_they_came() {
        let mut by_time = ByTime::<2>::default();
        for round in 0..2 {
            by_time.clear();
            for i in 0..14 {
                by_time.push(i * 5 % 3, [i as f32, -1.0]);
            }
            by_time.sort(4);
            let expected = |time: usize| (0..14).filter(|i| i * 5 % 3 == time).collect::<Vec<_>>();
            for time in 0..4 {
                assert_eq!(by_time.of(time), expected(time), "round {round}");
                let passing = |test: &dyn Fn(f32, f32) -> bool| {
                    let (first, end) = by_time.groups(time);
                    let groups = (first..end).step_by(GROUP);
                    let bits = |i| by_time.passing(i, |c, k| u32::from(test(c[0][k], c[1][k])));
                    let one_by_one = |i: usize| (0..GROUP).filter(move |k| bits(i) >> k & 1 == 1).map(move |k| (i, k));
                    groups.flat_map(one_by_one).map(|(i, k)| by_time.number(i, 1 << k)).collect::<Vec<_>>()
                };
                assert_eq!(passing(&|_, one| one < 0.0), expected(time), "the filling passes no test");
                for i in 0..14 {
                    let only: Vec<usize> = expected(time).into_iter().filter(|k| *k == i).collect();
                    assert_eq!(passing(&|number, _| number == i as f32), only, "{i} at {time}");
                }
            }
        }
    }
}
