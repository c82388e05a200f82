//! Things with a place and a time, sorted by time, so that those of one time are looked at together.

/// Things of one time are filled up to a multiple of this by things that are infinitely far away.
pub(super) const GROUP: usize = 4;

/// Things with `N` numbers each, of which the first is a coordinate; they are numbered in the order in which they were
/// added. The memory is reused.
#[derive(Debug, Clone)]
pub(super) struct ByTime<const N: usize> {
    /// Before sorting.
    added: Vec<(usize, [f64; N])>,
    /// Those of time `i` are at `starts[i]..starts[i + 1]`, with filling.
    starts: Vec<usize>,
    /// How many there are of each time.
    counts: Vec<usize>,
    order: Vec<usize>,
    columns: [Vec<f64>; N],
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
    pub(super) fn push(&mut self, time: usize, numbers: [f64; N]) {
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
            column.resize(n, f64::INFINITY);
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

    /// Some thing of a time passes a test, which answers 1 for yes and 0 for no, and 0 if the numbers are infinite. It is
    /// given the numbers of a group, column by column, and which of the group to test.
    #[inline(always)]
    pub(super) fn any(&self, time: usize, test: impl Fn(&[[f64; GROUP]; N], usize) -> u64) -> bool {
        let end = self.starts[time + 1];
        let mut found = 0;
        let mut i = self.starts[time];
        // Not by iterators: functions of theirs that are not inlined know nothing of wide machines.
        while i + GROUP <= end {
            let mut group = [[0.0; GROUP]; N];
            for (group, column) in group.iter_mut().zip(&self.columns) {
                if let [a, b, c, d] = column[i..i + GROUP] {
                    *group = [a, b, c, d];
                }
            }
            let in_group = [test(&group, 0), test(&group, 1), test(&group, 2), test(&group, 3)];
            found |= in_group[0] | in_group[1] | in_group[2] | in_group[3];
            i += GROUP;
        }
        found != 0
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
                by_time.push(i * 5 % 3, [i as f64, -1.0]);
            }
            by_time.sort(4);
            let expected = |time: usize| (0..14).filter(|i| i * 5 % 3 == time).collect::<Vec<_>>();
            for time in 0..4 {
                assert_eq!(by_time.of(time), expected(time), "round {round}");
                for i in 0..14 {
                    let found = by_time.any(time, |columns, k| u64::from(columns[0][k] == i as f64));
                    assert_eq!(found, expected(time).contains(&i), "{i} at {time}");
                }
                assert!(
                    !by_time.any(time, |columns, k| u64::from((0.0..1e9).contains(&columns[1][k]))),
                    "filling is far"
                );
            }
        }
    }
}
