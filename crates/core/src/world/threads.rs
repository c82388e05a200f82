//! The threads of a world: the calling thread works, too, and others help.

use std::process;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};

/// Threads of a world. A copy starts its own when it first needs them, and so does a process that was forked: threads do
/// not survive a fork.
#[derive(Debug)]
pub(crate) struct Threads {
    /// With the process in which they run; none before they are needed.
    pool: Mutex<Option<(u32, Arc<rayon::ThreadPool>)>>,
    n: usize,
}

impl Clone for Threads {
    fn clone(&self) -> Self {
        Self { pool: Mutex::new(None), n: self.n }
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        if let Some(found) = self.pool.get_mut().unwrap_or_else(PoisonError::into_inner).take() {
            Self::end(found);
        }
    }
}

impl Threads {
    /// Threads for work by `n` at once, one of them the calling thread.
    pub(crate) fn new(n: usize) -> Result<Self> {
        let threads = Self { pool: Mutex::new(None), n };
        if n > 1 {
            threads.pool()?;
        }
        Ok(threads)
    }

    /// The threads besides the calling one, started if this process has none.
    fn pool(&self) -> Result<Arc<rayon::ThreadPool>> {
        let mut kept = self.pool.lock().unwrap_or_else(PoisonError::into_inner);
        let process = process::id();
        if let Some((_, pool)) = kept.as_ref().filter(|(owner, _)| *owner == process) {
            return Ok(Arc::clone(pool));
        }
        let built = rayon::ThreadPoolBuilder::new().num_threads(self.n - 1).build();
        let n = self.n;
        let pool =
            Arc::new(built.map_err(|error| Error::invalid(format!("{n} threads could not be started: {error}")))?);
        if let Some(found) = kept.replace((process, Arc::clone(&pool))) {
            Self::end(found);
        }
        Ok(pool)
    }

    /// Lets go of threads; those of the process that was forked are not there to be told.
    fn end((owner, pool): (u32, Arc<rayon::ThreadPool>)) {
        if owner != process::id() {
            std::mem::forget(pool);
        }
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
        if n_threads < 2 {
            return take(0);
        }
        let Ok(pool) = self.pool() else { return take(0) };
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
