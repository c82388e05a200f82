//! The threads of a world: the calling thread works, too, and others help.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::error::{Error, Result};

/// Threads of a world.
#[derive(Debug)]
pub(crate) struct Threads {
    /// None for one thread.
    pool: Option<rayon::ThreadPool>,
    n: usize,
}

impl Threads {
    /// For work by so many at once, one of them the calling thread.
    pub(crate) fn new(n: usize) -> Result<Self> {
        if n < 2 {
            return Ok(Self { pool: None, n });
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n - 1).build();
        let pool = pool.map_err(|error| Error::invalid(format!("{n} threads could not be started: {error}")))?;
        Ok(Self { pool: Some(pool), n })
    }

    /// Calls `work(thread, i)` once for every i below `n`. They are handed out one by one in their order, the next one to
    /// any free thread; `thread` counts from 0, and no two calls with the same one run at the same time.
    ///
    /// The calling thread begins at once; the others need some time to wake up.
    pub(crate) fn each(&self, n: usize, work: impl Fn(usize, usize) + Sync) {
        let next = AtomicUsize::new(0);
        let take = |thread: usize| loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            if i >= n {
                break;
            }
            work(thread, i);
        };
        let n_threads = self.n.min(n);
        let Some(pool) = self.pool.as_ref().filter(|_| n_threads > 1) else { return take(0) };
        pool.in_place_scope(|scope| {
            for thread in 1..n_threads {
                let take = &take;
                scope.spawn(move |_| take(thread));
            }
            take(0);
        });
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn every_item_is_done_once_whatever_the_number_of_threads_and_no_thread_is_in_two_places() {
        for n in [1, 2, 5] {
            let threads = Threads::new(n).expect("threads");
            let (done, busy) = (Mutex::new(Vec::new()), [const { Mutex::new(()) }; 5]);
            threads.each(200, |thread, i| {
                let _own = busy[thread].try_lock().expect("thread indices are unique");
                done.lock().expect("no panic").push(i);
            });
            let mut done = done.into_inner().expect("no panic");
            done.sort_unstable();
            assert_eq!(done, (0..200).collect::<Vec<_>>());
            threads.each(0, |_, _| panic!("nothing to do"));
        }
    }
}
