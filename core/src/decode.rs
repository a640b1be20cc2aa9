//! Positions from cages, and how far they are from a capture: `P = Φ·Y` in single precision, where `Y` are the rows of a cage,
//! and where its normals are tied to them, those as well.

use crate::coordinates::TiedNormals;
use crate::dense;
use crate::inversion::product_columns;
use crate::mesh::Point;
use crate::simd::{self, multiversion};
use faer::{Mat, MatRef};
use rayon::prelude::*;
use std::sync::Arc;

/// Rows of Φ that one task multiplies: their product with a batch of cages stays in the second-level cache.
const BLOCK_ROWS: usize = 1024;

/// Turns cages into positions of the model's points.
#[derive(Clone, Debug)]
pub struct Decoder {
    /// `Φ`, n × m, column-major; zero rows follow up to a whole tile. Shared by the solvers of one analysis.
    phi: Arc<Mat<f32>>,
    points: usize,
    /// Columns of positions, which follow a translation; the others are of directions.
    positions: usize,
    /// What the values of all columns after the positions follow from; otherwise they are rows of the cage.
    normals: Option<Arc<TiedNormals>>,
}

/// Errors of one frame against the capture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameError {
    /// `sqrt(mean |e|²)` over the points, in the capture's unit.
    pub l2: f64,
    /// `max |e|`.
    pub linf: f64,
    /// `Σ |e|²`.
    pub squared: f64,
    /// `Σ |p − p̄|²` of the frame about its own centroid.
    pub spread: f64,
}

impl Decoder {
    /// Takes coordinates n × m whose first `positions` columns are of positions.
    pub fn new(phi: MatRef<'_, f64>, positions: usize) -> Self {
        let points = phi.nrows();
        let mut single = simd::zeros(points.next_multiple_of(dense::WHOLE_ROWS), phi.ncols());
        single.as_mut().par_col_chunks_mut(1).enumerate().for_each(|(j, mut column)| {
            for (s, &x) in column.as_mut().col_mut(0).iter_mut().zip(phi.col(j).iter()) {
                *s = x as f32;
            }
        });
        Self { phi: Arc::new(single), points, positions, normals: None }
    }

    /// Takes coordinates in single precision, n × `columns`, row-major, as they travel to who decodes elsewhere; the first
    /// `positions` columns are of positions. Decodes to the same bits as the decoder that they came from.
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
        phi.resize_with(points.next_multiple_of(dense::WHOLE_ROWS), phi.ncols(), |_, _| 0.0);
        Self { phi: Arc::new(phi), points, positions, normals: None }
    }

    /// The same coordinates for cages whose normals follow from their vertices.
    ///
    /// # Panics
    /// Where there is not one column per vertex and face.
    #[must_use]
    pub fn with_tied_normals(mut self, normals: Option<TiedNormals>) -> Self {
        if let Some(normals) = &normals {
            assert_eq!(self.columns(), self.positions + normals.faces().len(), "one column per vertex and face");
        }
        self.normals = normals.map(Arc::new);
        self
    }

    /// The rule by which normals follow from the vertices, where they do.
    pub fn tied_normals(&self) -> Option<&TiedNormals> {
        self.normals.as_deref()
    }

    /// Columns of positions, which follow a translation; they come first.
    pub fn positions(&self) -> usize {
        self.positions
    }

    /// Number of points n.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Number of columns of `Φ`.
    pub fn columns(&self) -> usize {
        self.phi.ncols()
    }

    /// Number of unknowns m: rows of a cage.
    pub fn unknowns(&self) -> usize {
        if self.normals.is_some() { self.positions } else { self.phi.ncols() }
    }

    fn padded(&self) -> MatRef<'_, f32> {
        (*self.phi).as_ref()
    }

    /// `Φ` in single precision, n × columns, column-major.
    pub fn coordinates(&self) -> MatRef<'_, f32> {
        self.padded().subrows(0, self.points)
    }

    /// Positions of up to [`BATCH`](crate::inversion::BATCH) frames, each n × 3 interleaved, from their cages, each m × 3 interleaved.
    ///
    /// The bits of a frame depend on its cage alone, not on the other frames of the batch.
    ///
    /// # Panics
    /// Where the lengths do not fit.
    pub fn decode(&self, cages: &[&[f32]], out: &mut [Vec<f32>]) {
        assert_eq!(cages.len(), out.len(), "one output per cage");
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
        parts.par_iter_mut().enumerate().for_each_init(
            || Mat::zeros(BLOCK_ROWS, columns.ncols()),
            |product, (block, parts)| {
                let product = self.block_product(block, columns.as_ref(), product);
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
    }

    /// Errors of up to [`BATCH`](crate::inversion::BATCH) frames: what [`Self::decode`] gives for these cages against the capture's own positions.
    ///
    /// # Panics
    /// Where the lengths do not fit.
    pub fn measure<T: Copy + Into<f64> + Sync>(&self, cages: &[&[f32]], frames: &[&[T]]) -> Vec<FrameError> {
        assert_eq!(cages.len(), frames.len(), "one frame per cage");
        let n = self.points();
        assert!(frames.iter().all(|f| f.len() == 3 * n), "every frame has every point");
        let (columns, centres) = self.values(cages);
        let blocks: Vec<Vec<Sums>> = (0..n.div_ceil(BLOCK_ROWS))
            .into_par_iter()
            .map_init(
                || Mat::zeros(BLOCK_ROWS, columns.ncols()),
                |product, block| {
                    let product = self.block_product(block, columns.as_ref(), product);
                    (0..frames.len())
                        .map(|f| {
                            let part = &frames[f][3 * block * BLOCK_ROWS..][..3 * product.nrows()];
                            block_sums(frame_columns(product, f), part, centres[f])
                        })
                        .collect()
                },
            )
            .collect();
        (0..frames.len()).map(|f| Sums::total(blocks.iter().map(|b| &b[f])).into_error(n)).collect()
    }

    /// The point of a frame that its cage leaves farthest from its place, and how far, in the capture's unit.
    ///
    /// # Panics
    /// Where the lengths do not fit.
    pub fn worst_point<T: Copy + Into<f64>>(&self, cage: &[f32], frame: &[T]) -> (u32, f64) {
        assert_eq!(frame.len(), 3 * self.points(), "every frame has every point");
        let mut decoded = [Vec::new()];
        self.decode(&[cage], &mut decoded);
        let squared = |(found, wanted): (&[f32], &[T])| -> f64 {
            found.iter().zip(wanted).map(|(&a, &b)| (f64::from(a) - b.into()).powi(2)).sum()
        };
        let distances = decoded[0].chunks_exact(3).zip(frame.chunks_exact(3)).map(squared);
        let (point, distance) =
            distances.enumerate().fold((0, 0.0), |worst, here| if here.1 > worst.1 { here } else { worst });
        (point as u32, distance.sqrt())
    }

    /// What `Φ` multiplies, side by side, three columns for each cage and padding; positions about their own centre, which keeps
    /// the digits of a capture that travels.
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
            if let Some(tied) = &self.normals {
                let vertex = |v: u32| [0, 1, 2].map(|k| f64::from(cage[3 * v as usize + k]));
                for (j, normal) in tied.normals(vertex).enumerate() {
                    for k in 0..3 {
                        columns[(self.positions + j, 3 * f + k)] = normal[k] as f32;
                    }
                }
            }
            centres.push(centre);
        }
        (columns, centres)
    }

    fn block_product<'a>(&self, block: usize, columns: MatRef<'_, f32>, product: &'a mut Mat<f32>) -> MatRef<'a, f32> {
        let first = block * BLOCK_ROWS;
        let rows = BLOCK_ROWS.min(self.points - first);
        let whole = rows.next_multiple_of(dense::WHOLE_ROWS);
        dense::multiply(product.as_mut().subrows_mut(0, whole), self.padded().subrows(first, whole), columns);
        product.as_ref().subrows(0, rows)
    }
}

fn frame_columns(product: MatRef<'_, f32>, frame: usize) -> [&[f32]; 3] {
    [0, 1, 2].map(|k| product.col(3 * frame + k).try_as_col_major().map_or(&[][..], |c| c.as_slice()))
}

/// Sums over the points of a block.
#[derive(Clone, Copy, Default)]
struct Sums {
    squared: f64,
    largest: f64,
    /// Sums of the positions about the frame's cage centre, and of their squares.
    first: Point,
    second: f64,
}

impl Sums {
    fn total<'a>(parts: impl Iterator<Item = &'a Self>) -> Self {
        parts.fold(Self::default(), |a, b| Self {
            squared: a.squared + b.squared,
            largest: a.largest.max(b.largest),
            first: [0, 1, 2].map(|k| a.first[k] + b.first[k]),
            second: a.second + b.second,
        })
    }

    fn into_error(self, points: usize) -> FrameError {
        let n = points as f64;
        let about_mean = self.first.iter().map(|s| s * s).sum::<f64>() / n;
        FrameError {
            l2: (self.squared / n).sqrt(),
            linf: self.largest.sqrt(),
            squared: self.squared,
            spread: (self.second - about_mean).max(0.0),
        }
    }
}

fn block_sums<T: Copy + Into<f64>>(columns: [&[f32]; 3], part: &[T], centre: Point) -> Sums {
    const STRIP: usize = 64;
    let mut sums = Sums::default();
    let mut strip = [[0.0; STRIP]; 3];
    for (s, points) in part.chunks(3 * STRIP).enumerate() {
        for (i, p) in points.chunks_exact(3).enumerate() {
            strip[0][i] = p[0].into();
            strip[1][i] = p[1].into();
            strip[2][i] = p[2].into();
        }
        let count = points.len() / 3;
        let here = columns.map(|c| &c[s * STRIP..][..count]);
        strip_sums(here, [&strip[0][..count], &strip[1][..count], &strip[2][..count]], &centre, &mut sums);
    }
    sums
}

multiversion! {
    fn strip_sums(decoded: [&[f32]; 3], truth: [&[f64]; 3], centre: &Point, sums: &mut Sums) = strip_sums_generic;
}

#[inline(always)]
fn strip_sums_generic(decoded: [&[f32]; 3], truth: [&[f64]; 3], centre: &Point, sums: &mut Sums) {
    const WIDE: usize = 8;
    let mut squared = [0.0f64; WIDE];
    let mut largest = [0.0f64; WIDE];
    let mut second = [0.0f64; WIDE];
    let mut first = [[0.0f64; WIDE]; 3];
    let count = decoded[0].len();
    let mut start = 0;
    while start < count {
        let width = WIDE.min(count - start);
        let mut e2 = [0.0f64; WIDE];
        for k in 0..3 {
            let mut d = [0.0f32; WIDE];
            let mut t = [0.0f64; WIDE];
            d[..width].copy_from_slice(&decoded[k][start..start + width]);
            t[..width].copy_from_slice(&truth[k][start..start + width]);
            for l in 0..WIDE {
                let used = if l < width { 1.0 } else { 0.0 };
                // Rounded as a decoder's output is, so that the figure is what a user would measure.
                let out = f64::from((f64::from(d[l]) + centre[k]) as f32);
                let e = (out - t[l]) * used;
                e2[l] += e * e;
                let about = (t[l] - centre[k]) * used;
                first[k][l] += about;
                second[l] += about * about;
            }
        }
        for l in 0..WIDE {
            squared[l] += e2[l];
            largest[l] = if e2[l] > largest[l] { e2[l] } else { largest[l] };
        }
        start += width;
    }
    for l in 0..WIDE {
        sums.squared += squared[l];
        sums.largest = if largest[l] > sums.largest { largest[l] } else { sums.largest };
        sums.second += second[l];
        for k in 0..3 {
            sums.first[k] += first[k][l];
        }
    }
}
