//! The one door into long work: without the interpreter lock, yet heard by Ctrl-C and progress bars.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use modfun::Error;
use modfun::threads::{self, Control};
use pyo3::prelude::*;

use crate::errors::{InternalError, to_python};

/// What `enter` gives to the work as its report of (done, total).
pub type Progress<'a> = dyn FnMut(usize, usize) -> Control + 'a;

thread_local! {
    /// What stopped the work of this thread, until [`enter`] raises it.
    static RAISED: Cell<Option<PyErr>> = const { Cell::new(None) };
}

fn control(heard: PyResult<()>) -> Control {
    match heard {
        Ok(()) => Control::Continue,
        Err(error) => {
            RAISED.set(Some(error));
            Control::Stop
        }
    }
}

/// Runs `work` with the interpreter released.
///
/// `work` hands its [`Progress`] to [`threads::run`], which calls it on this thread every 50 ms:
/// there signals are checked and the Python callable `progress(done, total)` is called. Work that this
/// thread does itself checks signals as often ([`threads::asking`]). What is raised stops the work and is
/// raised here. A panic becomes `InternalError`.
pub fn enter<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&mut Progress<'_>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let outcome = py.detach(|| {
        let mut report = |done: usize, total: usize| {
            let heard = Python::attach(|py| {
                py.check_signals()?;
                progress.as_ref().map_or(Ok(()), |call| call.call1(py, (done, total)).map(drop))
            });
            control(heard)
        };
        let ask = || control(Python::attach(|py| py.check_signals()));
        threads::asking(ask, || catch_unwind(AssertUnwindSafe(|| work(&mut report))))
    });
    if let Some(error) = RAISED.take() {
        return Err(error);
    }
    match outcome {
        Ok(result) => result.map_err(to_python),
        Err(payload) => {
            Err(InternalError::new_err(format!("panicked: {}", threads::panic_text(&*payload))))
        }
    }
}

/// The number of threads a call will use: `asked`, else MODFUN_NUM_THREADS, else the cores.
#[pyfunction]
#[pyo3(signature = (asked=None))]
pub fn thread_count(asked: Option<usize>) -> PyResult<usize> {
    threads::count(asked).map_err(to_python)
}

/// A worker that panics, so that tests can see what becomes of it.
#[pyfunction]
pub fn _panic_for_tests(py: Python<'_>, threads: usize) -> PyResult<()> {
    #[allow(clippy::panic)]
    let work = |(): &mut (), chunk: usize| {
        if chunk == 3 {
            panic!("asked to panic");
        }
    };
    enter(py, None, |report| threads::run(threads, 1000, report, || (), work)).map(drop)
}

/// Workers that end only when told, or after half a minute, so that tests can interrupt them.
#[pyfunction]
#[pyo3(signature = (threads, progress=None))]
pub fn _wait_for_tests(
    py: Python<'_>,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<()> {
    let started = std::time::Instant::now();
    let work = |(): &mut (), _: usize| {
        while !threads::stopped() && started.elapsed().as_secs() < 30 {
            std::hint::spin_loop();
        }
    };
    enter(py, progress, |report| threads::run(threads, 1000, report, || (), work)).map(drop)
}
