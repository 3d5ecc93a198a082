//! Functions of one number and products of matrices: the same bits on every processor.

use nalgebra::{DMatrix, DVector};

pub(crate) use libm::{exp, log as ln, pow};

/// a·b, added to `sum`, term by term. The product of `nalgebra` takes other code where a processor has fused
/// multiplication.
pub(crate) fn add_product(sum: &mut DMatrix<f64>, a: &DMatrix<f64>, b: &DMatrix<f64>) {
    for (column, mut sum) in b.column_iter().zip(sum.column_iter_mut()) {
        for (a, &b) in a.column_iter().zip(&column) {
            sum.iter_mut().zip(&a).for_each(|(sum, a)| *sum += a * b);
        }
    }
}

/// a·b.
pub(crate) fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(a.nrows(), b.ncols());
    add_product(&mut product, a, b);
    product
}

/// a·x.
pub(crate) fn apply(a: &DMatrix<f64>, x: &DVector<f64>) -> DVector<f64> {
    let mut sum = DVector::zeros(a.nrows());
    for (a, &x) in a.column_iter().zip(x) {
        sum.iter_mut().zip(&a).for_each(|(sum, a)| *sum += a * x);
    }
    sum
}
