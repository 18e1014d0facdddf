//! Memory kept from one call to the next: whoever needs a piece takes one, or makes it, and gives it back.

use std::sync::{Mutex, PoisonError};

/// Pieces that are kept; more threads than that at once make theirs anew.
const MOST: usize = 16;

/// Pieces that lie ready. Threads that call at the same time get different ones.
pub(crate) struct Spare<T>(Mutex<Vec<T>>);

/// A piece in use, given back when dropped.
pub(crate) struct Lent<'a, T> {
    of: &'a Spare<T>,
    piece: Option<T>,
}

impl<T> Spare<T> {
    pub fn new() -> Spare<T> {
        Spare(Mutex::new(Vec::new()))
    }

    pub fn lend(&self) -> Lent<'_, T> {
        Lent { of: self, piece: self.0.lock().unwrap_or_else(PoisonError::into_inner).pop() }
    }
}

impl<T> Lent<'_, T> {
    /// The piece, made where none lay ready.
    pub fn get_or(&mut self, make: impl FnOnce() -> T) -> &mut T {
        self.piece.get_or_insert_with(make)
    }
}

impl<T> Drop for Lent<'_, T> {
    fn drop(&mut self) {
        let mut pieces = self.of.0.lock().unwrap_or_else(PoisonError::into_inner);
        if pieces.len() < MOST {
            pieces.extend(self.piece.take());
        }
    }
}
