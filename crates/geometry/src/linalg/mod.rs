//! Dense linear algebra on faer, whose bits do not depend on the number of threads.

mod eigen;
mod factors;
mod products;
mod small;
mod sparse;
mod sparse_cholesky;
pub mod svd;
mod zeros;

pub use eigen::eigen;
pub use factors::{
    Pivoted, cholesky, cholesky_in_place, inverse, pivoted, pivoted_cholesky, solve_cholesky, solve_definite,
    solve_definite_within, solve_lower, upper_factor, upper_inverse,
};
pub use products::{
    BLOCK_ROWS, TILE_COLUMNS, TILE_ROWS, accumulate_product, gram, lower_product, mirrored, multiply, multiply_add,
    product, rows_of, tall_product, to_double, to_single, transposed_product,
};
pub use small::{nearest_rotation, symmetric_eigen};
pub use sparse::SparseMatrix;
pub use sparse_cholesky::{SparseCholesky, SparsePattern};
pub use zeros::zeros;
