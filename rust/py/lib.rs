//! The extension module `modfun._core`: converts, calls the core, converts back.

mod arrays;
mod enter;
mod errors;
mod fit;
mod integrate;
mod joint;
mod line_tests;
mod random;
mod response;
mod signals;
mod stream;
mod study;
mod tally;
mod terms;
mod tones;

use pyo3::prelude::*;

/// The compiled core of modfun.
#[pymodule(gil_used = true)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("STREAM_VERSION", modfun::rng::STREAM_VERSION)?;
    module.add_class::<fit::Fitter>()?;
    module.add_class::<joint::JointFitter>()?;
    module.add_class::<terms::TermsFitter>()?;
    module.add_class::<stream::Stream>()?;
    module.add_class::<study::Study>()?;
    module.add_function(wrap_pyfunction!(tally::merge_moments, module)?)?;
    module.add_function(wrap_pyfunction!(tally::figures, module)?)?;
    module.add_function(wrap_pyfunction!(tally::count_errors, module)?)?;
    module.add_function(wrap_pyfunction!(tally::quantiles, module)?)?;
    signals::register(module)?;
    line_tests::register(module)?;
    module.add_function(wrap_pyfunction!(integrate::integrate, module)?)?;
    module.add_function(wrap_pyfunction!(response::local_responses, module)?)?;
    module.add_function(wrap_pyfunction!(random::normal_rows, module)?)?;
    module.add_function(wrap_pyfunction!(random::normals, module)?)?;
    module.add_function(wrap_pyfunction!(tones::sinusoids, module)?)?;
    module.add_function(wrap_pyfunction!(enter::thread_count, module)?)?;
    module.add_function(wrap_pyfunction!(enter::_panic_for_tests, module)?)?;
    module.add_function(wrap_pyfunction!(enter::_wait_for_tests, module)?)?;
    Ok(())
}
