//! Decoding: positions `P = Φ·Y` in single precision from a cage's rows Y, and their errors.

mod error;
mod phi;
mod poles;

pub use error::FrameError;
pub use poles::{Bound, Survey, beside_poles};

use crate::batch::{BATCH, product_columns};
use crate::cage::Cage;
use crate::coordinates::{DependentNormals, PointwiseCoordinates, for_each_chunk};
use cager_geometry::linalg::{self, BLOCK_ROWS};
use cager_geometry::mesh::Point;
use error::{Sums, block_sums};
use faer::{Mat, MatRef};
use phi::{Phi, padded, to_padded_single};
use rayon::prelude::*;
use std::sync::Arc;

/// Turns cages into positions of the model's points.
#[derive(Clone, Debug)]
pub struct Decoder {
    /// Shared by the solvers of one analysis.
    phi: Phi,
    points: usize,
    /// Number of leading columns of `Φ` that multiply vertices; the others multiply normals.
    positions: usize,
    /// Computes the normals from the vertices; `None` where normals are rows of the cage.
    normals: Option<Arc<DependentNormals>>,
}

impl Decoder {
    /// Takes coordinates n × m whose first `positions` columns multiply vertices.
    pub fn new(phi: MatRef<'_, f64>, positions: usize) -> Self {
        let (points, phi) = (phi.nrows(), Phi::Stored(Arc::new(to_padded_single(phi))));
        Self { phi, points, positions, normals: None }
    }

    /// Stores the coordinates of these points in single precision, computed chunk by chunk.
    pub fn with_stored_coordinates(
        pointwise: PointwiseCoordinates,
        cage: &Cage,
        points: &[Point],
        columns: usize,
    ) -> Self {
        let mut phi = padded(points.len(), columns);
        for_each_chunk(pointwise, cage, points, columns, |first, part| {
            for j in 0..columns {
                let to = phi.col_as_slice_mut(j)[first..].iter_mut();
                to.zip(part.phi.col(j).iter()).for_each(|(to, &x)| *to = x as f32);
            }
        });
        Self { phi: Phi::Stored(Arc::new(phi)), points: points.len(), positions: cage.vertices().len(), normals: None }
    }

    /// Recomputes the coordinates of these points chunk by chunk at every use, to the same bits:
    /// for models whose `Φ` exceeds memory.
    pub fn with_recomputed_coordinates(
        pointwise: PointwiseCoordinates,
        cage: &Cage,
        points: &[Point],
        columns: usize,
    ) -> Self {
        let positions = cage.vertices().len();
        let phi = Phi::computed(pointwise, cage.clone(), points.to_vec(), columns);
        Self { phi, points: points.len(), positions, normals: None }
    }

    /// Takes coordinates in single precision, n × `columns`, row-major, as the service sends them;
    /// the first `positions` columns multiply vertices.
    ///
    /// # Panics
    /// Where the values are not whole rows.
    pub fn from_rows(values: &[f32], columns: usize, positions: usize) -> Self {
        assert!(values.len().is_multiple_of(columns), "whole rows of {columns} coordinates");
        let rows = MatRef::from_row_major_slice(values, values.len() / columns, columns);
        Self::from_single(rows.to_owned(), positions)
    }

    /// Takes coordinates n × m that are in single precision already.
    pub(crate) fn from_single(mut phi: Mat<f32>, positions: usize) -> Self {
        let points = phi.nrows();
        phi.resize_with(points.next_multiple_of(linalg::TILE_ROWS), phi.ncols(), |_, _| 0.0);
        Self { phi: Phi::Stored(Arc::new(phi)), points, positions, normals: None }
    }

    /// The same coordinates for cages whose normals follow from their vertices.
    ///
    /// # Panics
    /// Where there is not one column per vertex and face.
    #[must_use]
    pub fn with_dependent_normals(mut self, normals: Option<DependentNormals>) -> Self {
        if let Some(normals) = &normals {
            assert_eq!(self.columns(), self.positions + normals.faces().len(), "one column per vertex and face");
        }
        self.normals = normals.map(Arc::new);
        self
    }

    /// The same, but for some points whose coordinates are others.
    #[must_use]
    pub fn with_bound(mut self, bound: Bound) -> Self {
        self.phi.bind(bound);
        self
    }

    /// How normals are computed from the vertices; `None` where they are unknowns or absent.
    pub fn dependent_normals(&self) -> Option<&DependentNormals> {
        self.normals.as_deref()
    }

    /// Number of columns that multiply vertices; they come first.
    pub fn positions(&self) -> usize {
        self.positions
    }

    /// Number of points n.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Number of columns of `Φ`.
    pub fn columns(&self) -> usize {
        self.phi.columns()
    }

    /// Number of unknowns m: rows of a cage.
    pub fn unknowns(&self) -> usize {
        if self.normals.is_some() { self.positions } else { self.columns() }
    }

    /// `Φ` in single precision, n × columns, column-major; `None` where it is not stored.
    pub fn coordinates(&self) -> Option<MatRef<'_, f32>> {
        self.phi.kept().map(|phi| phi.subrows(0, self.points))
    }

    /// A decoder of some of the points, in this order.
    #[must_use]
    pub fn of_points(&self, points: &[u32]) -> Self {
        Self { normals: self.normals.clone(), ..Self::from_single(self.rows(points), self.positions) }
    }

    /// Some rows of `Φ`.
    pub(crate) fn rows(&self, rows: &[u32]) -> Mat<f32> {
        self.phi.rows(rows)
    }

    /// Bytes of the coordinates that are kept.
    pub fn size_bytes(&self) -> usize {
        self.coordinates().map_or(0, |phi| 4 * phi.nrows() * phi.ncols())
    }

    /// Positions of frames, each n × 3 interleaved, from their cages, each m × 3 interleaved. The
    /// result of a frame is bit-identical whatever the other frames.
    ///
    /// # Panics
    /// Where the lengths do not fit.
    pub fn decode(&self, cages: &[&[f32]], out: &mut [Vec<f32>]) {
        assert_eq!(cages.len(), out.len(), "one output per cage");
        cages.chunks(BATCH).zip(out.chunks_mut(BATCH)).for_each(|(cages, out)| self.decode_batch(cages, out));
    }

    fn decode_batch(&self, cages: &[&[f32]], out: &mut [Vec<f32>]) {
        let (columns, centres) = self.values(cages);
        let n = self.points();
        for positions in out.iter_mut() {
            positions.resize(3 * n, 0.0);
        }
        // Frames are split into the same blocks, so that each task owns its part of every frame.
        let mut parts: Vec<Vec<&mut [f32]>> =
            (0..n.div_ceil(BLOCK_ROWS)).map(|_| Vec::with_capacity(out.len())).collect();
        for positions in out.iter_mut() {
            for (part, chunk) in parts.iter_mut().zip(positions.chunks_mut(3 * BLOCK_ROWS)) {
                part.push(chunk);
            }
        }
        self.phi.for_each_part(|first, phi| {
            let blocks = phi.nrows().div_ceil(BLOCK_ROWS);
            parts[first / BLOCK_ROWS..][..blocks].par_iter_mut().enumerate().for_each_init(
                || Mat::zeros(BLOCK_ROWS, columns.ncols()),
                |product, (block, parts)| {
                    let rows = parts.first().map_or(0, |part| part.len() / 3);
                    let product = block_product(phi, block, rows, columns.as_ref(), product);
                    for (f, part) in parts.iter_mut().enumerate() {
                        let [x, y, z] = frame_columns(product, f);
                        for (i, p) in part.chunks_exact_mut(3).enumerate() {
                            p[0] = (f64::from(x[i]) + centres[f][0]) as f32;
                            p[1] = (f64::from(y[i]) + centres[f][1]) as f32;
                            p[2] = (f64::from(z[i]) + centres[f][2]) as f32;
                        }
                    }
                },
            );
        });
    }

    /// The largest sum of sizes that [`Self::decode`] adds up for a coordinate of a point in any of
    /// these cages, or more: its rounding errors are a fraction of it.
    pub fn largest_sum(&self, cages: &[&[f32]]) -> f64 {
        // Of each column, along each axis.
        let mut sizes = vec![[0.0f32; 3]; self.columns()];
        for cages in cages.chunks(BATCH) {
            let (columns, _) = self.values(cages);
            for (j, sizes) in sizes.iter_mut().enumerate() {
                columns.row(j).iter().enumerate().for_each(|(at, x)| sizes[at % 3] = sizes[at % 3].max(x.abs()));
            }
        }
        let mut largest = 0.0f32;
        self.phi.for_each_part(|_, phi| {
            let blocks = (0..phi.nrows()).into_par_iter().step_by(BLOCK_ROWS);
            let of_block = |first: usize| {
                let rows = BLOCK_ROWS.min(phi.nrows() - first);
                let mut sums = vec![[0.0f32; 3]; rows];
                for (j, sizes) in sizes.iter().enumerate() {
                    let column = phi.col(j).subrows(first, rows);
                    for (sums, x) in sums.iter_mut().zip(column.iter()) {
                        sums.iter_mut().zip(sizes).for_each(|(sum, size)| *sum += x.abs() * size);
                    }
                }
                sums.as_flattened().iter().copied().fold(0.0, f32::max)
            };
            largest = largest.max(blocks.map(of_block).reduce(|| 0.0, f32::max));
        });
        f64::from(largest)
    }

    /// Errors of frames: what [`Self::decode`] gives against the capture's own positions.
    pub fn measure<T: Copy + Into<f64> + Sync>(&self, cages: &[&[f32]], frames: &[&[T]]) -> Vec<FrameError> {
        assert_eq!(cages.len(), frames.len(), "one frame per cage");
        let n = self.points();
        assert!(frames.iter().all(|f| f.len() == 3 * n), "every frame has every point");
        let batches = cages.chunks(BATCH).zip(frames.chunks(BATCH));
        batches.flat_map(|(cages, frames)| self.measure_batch(cages, frames)).collect()
    }

    fn measure_batch<T: Copy + Into<f64> + Sync>(&self, cages: &[&[f32]], frames: &[&[T]]) -> Vec<FrameError> {
        let n = self.points();
        let (columns, centres) = self.values(cages);
        let mut blocks: Vec<Vec<Sums>> = Vec::with_capacity(n.div_ceil(BLOCK_ROWS));
        self.phi.for_each_part(|first, phi| {
            let count = phi.nrows().div_ceil(BLOCK_ROWS);
            blocks.par_extend((0..count).into_par_iter().map_init(
                || Mat::zeros(BLOCK_ROWS, columns.ncols()),
                |product, block| {
                    let start = first + block * BLOCK_ROWS;
                    let product = block_product(phi, block, BLOCK_ROWS.min(n - start), columns.as_ref(), product);
                    let part = |f: usize| &frames[f][3 * start..][..3 * product.nrows()];
                    (0..frames.len())
                        .map(|f| block_sums(frame_columns(product, f), part(f), centres[f], start))
                        .collect()
                },
            ));
        });
        (0..frames.len()).map(|f| Sums::total(blocks.iter().map(|b| &b[f])).into_error(n)).collect()
    }

    /// The matrix that `Φ` multiplies, three columns per cage and padding, and the cages' centres,
    /// to which vertices are relative.
    fn values(&self, cages: &[&[f32]]) -> (Mat<f32>, Vec<Point>) {
        let m = self.unknowns();
        assert!(cages.iter().all(|c| c.len() == 3 * m), "every cage has every unknown");
        let mut columns = Mat::zeros(self.columns(), product_columns(cages.len()));
        let mut centres = Vec::with_capacity(cages.len());
        for (f, cage) in cages.iter().enumerate() {
            let mut centre = [0.0; 3];
            for row in cage.chunks_exact(3).take(self.positions) {
                for k in 0..3 {
                    centre[k] += f64::from(row[k]);
                }
            }
            let centre = centre.map(|c| c / self.positions as f64);
            for (j, row) in cage.chunks_exact(3).enumerate() {
                for k in 0..3 {
                    let shift = if j < self.positions { centre[k] } else { 0.0 };
                    columns[(j, 3 * f + k)] = (f64::from(row[k]) - shift) as f32;
                }
            }
            if let Some(dependent) = &self.normals {
                let vertex = |v: u32| [0, 1, 2].map(|k| f64::from(cage[3 * v as usize + k]));
                for (j, normal) in dependent.normals(vertex).enumerate() {
                    for k in 0..3 {
                        columns[(self.positions + j, 3 * f + k)] = normal[k] as f32;
                    }
                }
            }
            centres.push(centre);
        }
        (columns, centres)
    }
}

/// `rows` rows of the product of a block of `phi` with columns.
fn block_product<'a>(
    phi: MatRef<'_, f32>,
    block: usize,
    rows: usize,
    columns: MatRef<'_, f32>,
    product: &'a mut Mat<f32>,
) -> MatRef<'a, f32> {
    let whole = rows.next_multiple_of(linalg::TILE_ROWS);
    linalg::multiply(product.as_mut().subrows_mut(0, whole), phi.subrows(block * BLOCK_ROWS, whole), columns);
    product.as_ref().subrows(0, rows)
}

/// The columns of a frame in a product, which [`block_product`] makes column by column.
fn frame_columns(product: MatRef<'_, f32>, frame: usize) -> [&[f32]; 3] {
    [0, 1, 2].map(|k| product.col(3 * frame + k).try_as_col_major().expect("contiguous columns").as_slice())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "contiguous columns")]
    fn columns_that_are_not_contiguous_are_not_taken_for_empty_ones() {
        frame_columns(Mat::zeros(3, 8).transpose(), 0);
    }
}
