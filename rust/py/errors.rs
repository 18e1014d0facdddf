//! Core errors as the Python exceptions of `modfun.errors`.

use modfun::Error;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::{PyErr, import_exception};

import_exception!(modfun.errors, DataError);
import_exception!(modfun.errors, SpecError);
import_exception!(modfun.errors, InternalError);

/// The exception a user sees. `Cancelled` is asked for by Ctrl-C only, hence `KeyboardInterrupt`.
pub fn to_python(error: Error) -> PyErr {
    match error {
        Error::Data(text) => DataError::new_err(text),
        Error::Spec(text) => SpecError::new_err(text),
        Error::Internal(text) => InternalError::new_err(text),
        Error::Cancelled => PyKeyboardInterrupt::new_err(()),
    }
}
