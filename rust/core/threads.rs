//! Scoped threads over a shared chunk counter: the one file that starts threads.
//!
//! Nothing outlives a call, so there is no pool to shut down and forking is safe. The calling thread waits in
//! slices, reports progress and may stop the work; it does chunks only where no thread is worth starting. Long
//! loops ask [`stopped`], on whatever thread they run.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::Error;

/// How long the calling thread waits between two looks at progress.
const SLICE: Duration = Duration::from_millis(50);

/// The answer to a progress report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop as soon as possible; the run returns [`Error::Cancelled`].
    Stop,
}

/// What a thread learns from that its work is to end.
enum Told {
    /// From the thread that waits for it.
    By(Arc<AtomicBool>),
    /// From a question of its own, not to be asked before this moment.
    Asks(fn() -> Control, Instant),
    /// It knows.
    Stop,
}

thread_local! {
    static TOLD: RefCell<Option<Told>> = const { RefCell::new(None) };
}

/// Sets what this thread learns from, and what it was before when dropped.
struct ToldHere(Option<Told>);

impl ToldHere {
    fn new(told: Told) -> ToldHere {
        ToldHere(TOLD.replace(Some(told)))
    }
}

impl Drop for ToldHere {
    fn drop(&mut self) {
        TOLD.set(self.0.take());
    }
}

/// Does work of the calling thread that asks every 50 ms whether to go on, where it is loops of this crate.
///
/// After [`Control::Stop`] these loops leave early: what `work` returns then is not to be used.
pub fn asking<T>(ask: fn() -> Control, work: impl FnOnce() -> T) -> T {
    let _here = ToldHere::new(Told::Asks(ask, Instant::now() + SLICE));
    work()
}

/// Whether the work on this thread is to end: loops that may be long leave, whatever they then return.
#[must_use]
pub fn stopped() -> bool {
    let ask = TOLD.with_borrow_mut(|told| match told {
        None => Err(false),
        Some(Told::Stop) => Err(true),
        Some(Told::By(flag)) => Err(flag.load(Ordering::Relaxed)),
        Some(Told::Asks(ask, due)) => {
            let now = Instant::now();
            if now < *due {
                return Err(false);
            }
            *due = now + SLICE;
            Ok(*ask)
        }
    });
    // Asked without the borrow: the answer may run anything.
    match ask {
        Err(known) => known,
        Ok(ask) => {
            let stop = ask() == Control::Stop;
            if stop {
                TOLD.set(Some(Told::Stop));
            }
            stop
        }
    }
}

/// The number of threads for a call: what was asked for, else `MODFUN_NUM_THREADS`, else the
/// cores this process may use.
///
/// # Errors
/// [`Error::Spec`] where the number asked for is 0 or the variable is not a positive number.
pub fn count(asked: Option<usize>) -> Result<usize, Error> {
    let from_environment = std::env::var("MODFUN_NUM_THREADS").ok();
    count_from(asked, from_environment.as_deref())
}

fn count_from(asked: Option<usize>, environment: Option<&str>) -> Result<usize, Error> {
    match (asked, environment.map(str::trim)) {
        (Some(0), _) => {
            Err(Error::Spec("threads=0: give a number of at least 1, or None for all cores".into()))
        }
        (Some(n), _) => Ok(n),
        (None, None | Some("")) => Ok(std::thread::available_parallelism().map_or(1, usize::from)),
        (None, Some(text)) => match text.parse() {
            Ok(n) if n > 0 => Ok(n),
            _ => Err(Error::Spec(format!(
                "MODFUN_NUM_THREADS={text:?} is not a number of threads: set it to 1 or more, or unset it"
            ))),
        },
    }
}

/// Raises the stop flag when the calling thread leaves, also by a panic in `progress`.
struct StopOnLeaving<'a>(&'a AtomicBool);

impl Drop for StopOnLeaving<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Takes one worker off the count of running ones, however it ends.
struct Running<'a>(&'a Mutex<usize>, &'a Condvar);

impl Drop for Running<'_> {
    fn drop(&mut self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
        self.1.notify_all();
    }
}

/// Computes `work(worker, chunk)` for each chunk `0..chunks` and returns the results in chunk
/// order, which do not depend on the number of threads if `work` forgets the chunks before.
///
/// Each thread makes its own worker (scratch memory). `progress(chunks done, chunks)` is called on
/// the calling thread every 50 ms and once at the end; where it answers [`Control::Stop`], no new
/// chunk is begun, and [`stopped`] tells long chunks to return early (their results are dropped).
///
/// With 0 threads the calling thread does the work and reports at the end only: for work so short that
/// starting a thread would take longer.
///
/// # Errors
/// [`Error::Cancelled`] after a stop; [`Error::Internal`] with the text of the panic where
/// `make_worker` or `work` panicked, as soon as the other threads have left their chunks.
pub fn run<W, T: Send>(
    threads: usize,
    chunks: usize,
    progress: &mut dyn FnMut(usize, usize) -> Control,
    make_worker: impl Fn() -> W + Sync,
    work: impl Fn(&mut W, usize) -> T + Sync,
) -> Result<Vec<T>, Error> {
    let stop = Arc::new(AtomicBool::new(false));
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let panicked: Mutex<Option<String>> = Mutex::new(None);
    let (running, finished) = (Mutex::new(0), Condvar::new());

    let thread = || {
        let _running = Running(&running, &finished);
        let mut results = Vec::new();
        let current = Cell::new(None);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let mut worker = make_worker();
            while !stopped() {
                let chunk = next.fetch_add(1, Ordering::Relaxed);
                if chunk >= chunks {
                    break;
                }
                current.set(Some(chunk));
                results.push((chunk, work(&mut worker, chunk)));
                done.fetch_add(1, Ordering::Relaxed);
            }
        }));
        if let Err(payload) = outcome {
            stop.store(true, Ordering::Relaxed);
            let place = match current.get() {
                Some(chunk) => format!("chunk {chunk} of {chunks}"),
                None => "setting up".into(),
            };
            let text = format!("a worker panicked in {place}: {}", panic_text(&*payload));
            panicked.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(text);
        }
        results
    };
    let told = || {
        let _here = ToldHere::new(Told::By(Arc::clone(&stop)));
        thread()
    };

    let mut slots: Vec<Option<T>> = (0..chunks).map(|_| None).collect();
    let mut cancelled = false;
    std::thread::scope(|scope| {
        let _stop = StopOnLeaving(&stop);
        let mut handles = Vec::new();
        let mut here = Vec::new();
        if threads == 0 {
            *running.lock().unwrap_or_else(PoisonError::into_inner) += 1;
            here = thread();
        }
        for _ in 0..threads.min(chunks) {
            *running.lock().unwrap_or_else(PoisonError::into_inner) += 1;
            match std::thread::Builder::new().name("modfun".into()).spawn_scoped(scope, told) {
                Ok(handle) => handles.push(handle),
                Err(error) => {
                    *running.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
                    // Fewer threads do the same work; only none at all is a failure.
                    if handles.is_empty() {
                        return Err(Error::Internal(format!(
                            "no thread could be started: {error}"
                        )));
                    }
                    break;
                }
            }
        }
        let mut report = |cancelled: &mut bool| {
            if !*cancelled && progress(done.load(Ordering::Relaxed), chunks) == Control::Stop {
                *cancelled = true;
                stop.store(true, Ordering::Relaxed);
            }
        };
        let mut left = running.lock().unwrap_or_else(PoisonError::into_inner);
        let mut due = Instant::now() + SLICE;
        while *left > 0 {
            let wait = due.saturating_duration_since(Instant::now());
            left = finished.wait_timeout(left, wait).unwrap_or_else(PoisonError::into_inner).0;
            if *left > 0 && Instant::now() >= due {
                // Not under the lock: progress may take its time.
                drop(left);
                report(&mut cancelled);
                due = Instant::now() + SLICE;
                left = running.lock().unwrap_or_else(PoisonError::into_inner);
            }
        }
        drop(left);
        // Panics were caught inside, so every thread gives its results.
        let theirs = handles.into_iter().flat_map(|handle| handle.join().unwrap_or_default());
        for (chunk, result) in here.into_iter().chain(theirs) {
            slots[chunk] = Some(result);
        }
        report(&mut cancelled);
        Ok(())
    })?;
    if let Some(text) = panicked.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(Error::Internal(text));
    }
    if cancelled || (threads == 0 && stopped()) {
        return Err(Error::Cancelled);
    }
    let missing = || Error::Internal("a chunk was lost".into());
    slots.into_iter().map(|slot| slot.ok_or_else(missing)).collect()
}

/// What a panic said.
#[must_use]
pub fn panic_text(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no text")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn go_on(_: usize, _: usize) -> Control {
        Control::Continue
    }

    proptest! {
        #[test]
        fn results_come_in_chunk_order(threads in 0usize..6, chunks in 0usize..40) {
            let work = |count: &mut usize, chunk: usize| {
                *count += 1;
                if chunk.is_multiple_of(3) {
                    std::thread::yield_now();
                }
                chunk * chunk
            };
            let got = run(threads, chunks, &mut go_on, || 0, work);
            prop_assert_eq!(got, Ok((0..chunks).map(|k| k * k).collect::<Vec<_>>()));
        }
    }

    #[test]
    fn a_panic_becomes_an_error_and_stops_the_others() {
        for threads in [0, 1, 2, 5] {
            let started = Instant::now();
            let work = |(): &mut (), chunk: usize| {
                assert!(chunk != 3, "chunk three is bad");
                // The others would take for ever, were they not told.
                while chunk > 3 && !stopped() {
                    std::thread::yield_now();
                }
            };
            let error = run(threads, 1000, &mut go_on, || (), work).unwrap_err();
            assert_eq!(
                error,
                Error::Internal("a worker panicked in chunk 3 of 1000: chunk three is bad".into())
            );
            assert!(started.elapsed() < Duration::from_secs(10));
        }
    }

    #[test]
    fn a_worker_that_cannot_be_made_is_an_error() {
        let make = || -> () { panic!("no memory") };
        for threads in [0, 2] {
            let error = run(threads, 5, &mut go_on, make, |(), _| ()).unwrap_err();
            assert_eq!(error, Error::Internal("a worker panicked in setting up: no memory".into()));
        }
    }

    #[test]
    fn no_threads_means_the_calling_one() {
        let here = std::thread::current().id();
        let whose = run(0, 3, &mut go_on, || (), |(), _| std::thread::current().id());
        assert_eq!(whose, Ok(vec![here; 3]));
        let theirs = run(1, 3, &mut go_on, || (), |(), _| std::thread::current().id()).unwrap();
        assert!(!theirs.contains(&here));
        let stop = run(0, 3, &mut |_, _| Control::Stop, || (), |(), _| ());
        assert_eq!(stop, Err(Error::Cancelled));
    }

    #[test]
    fn a_panic_in_progress_leaves_no_thread_behind() {
        let endless = |(): &mut (), _: usize| {
            while !stopped() {
                std::thread::yield_now();
            }
        };
        let mut bad = |_: usize, _: usize| -> Control { panic!("bar broke") };
        let outcome = catch_unwind(AssertUnwindSafe(|| run(2, 2, &mut bad, || (), endless)));
        assert_eq!(panic_text(&*outcome.unwrap_err()), "bar broke");
    }

    #[test]
    fn progress_stops_the_work() {
        for threads in [1, 2] {
            let started = Instant::now();
            let begun = AtomicUsize::new(0);
            let work = |(): &mut (), _: usize| {
                begun.fetch_add(1, Ordering::Relaxed);
                while !stopped() {
                    std::thread::sleep(Duration::from_millis(1));
                }
            };
            let mut calls = 0;
            let mut progress = |done: usize, total: usize| {
                calls += 1;
                assert_eq!((done, total), (0, 100));
                Control::Stop
            };
            assert_eq!(run(threads, 100, &mut progress, || (), work), Err(Error::Cancelled));
            assert_eq!(calls, 1);
            assert_eq!(begun.into_inner(), threads);
            assert!(started.elapsed() < Duration::from_secs(10));
        }
    }

    #[test]
    fn progress_sees_the_end_and_short_work_does_not_wait_a_slice() {
        let started = Instant::now();
        for _ in 0..100 {
            let mut seen = Vec::new();
            let mut progress = |done, total| {
                seen.push((done, total));
                Control::Continue
            };
            run(2, 4, &mut progress, || (), |(), _| ()).unwrap();
            assert_eq!(seen.last(), Some(&(4, 4)));
        }
        // A hundred slices would be 5 s.
        assert!(started.elapsed() < Duration::from_millis(2500));
    }

    #[test]
    fn work_of_the_calling_thread_asks_and_leaves() {
        let wait = || while !stopped() {};
        let started = Instant::now();
        assert!(!stopped());
        let seen = asking(
            || Control::Stop,
            || {
                // Not before a slice is over: short work is left alone.
                assert!(!stopped());
                wait();
                // It stays told, and chunks are neither ended nor begun.
                (stopped(), run(0, 3, &mut go_on, || (), |(), _| ()))
            },
        );
        assert_eq!(seen, (true, Err(Error::Cancelled)));
        assert!(started.elapsed() >= SLICE);
        // Inside other such work, and after it, whoever was asked before is asked again.
        asking(
            || Control::Continue,
            || {
                asking(|| Control::Stop, wait);
                std::thread::sleep(2 * SLICE);
                assert!(!stopped());
            },
        );
        assert!(!stopped());
    }

    #[test]
    fn the_number_of_threads() {
        assert_eq!(count_from(Some(3), Some("5")), Ok(3));
        assert_eq!(count_from(None, Some(" 5 ")), Ok(5));
        assert!(count_from(None, None).unwrap() >= 1);
        assert_eq!(count_from(None, Some("")), count_from(None, None));
        for bad in ["0", "-1", "two", "1.5"] {
            assert!(
                matches!(count_from(None, Some(bad)), Err(Error::Spec(text)) if text.contains(bad))
            );
        }
        assert!(matches!(count_from(Some(0), None), Err(Error::Spec(_))));
    }
}
