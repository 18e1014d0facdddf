//! Factors of one large problem, as the crate of dense factorisations makes them.

pub(crate) use modfun_dense::{Cholesky, Lu, Qr, inverse_of_upper, product, transposed_product};
