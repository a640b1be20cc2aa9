//! About how many bytes coded frames take by the size of their cage, before any cage is designed.

use super::fit::{BLOCK_ROWS, Fit, ridge_factor};
use super::parts::Parts;
use super::samples::{RIDGE, Samples, principal};
use crate::enclose::{EncloseError, EncloseOptions, enclose};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_geometry::linalg::{gram, to_double};
use cager_geometry::mesh::Model;
use faer::{Mat, MatRef};

/// Vertices of the cage around the rest pose that rates are measured with.
pub(crate) const MEASURED: usize = 80;
/// Fewest and most vertices that are suggested: beyond, files hardly shrink and designs take long.
const LEAST: usize = 80;
const MOST: usize = 500;
/// Smallest error that a size in bytes is looked at for.
const LEAST_ERROR: f64 = 1e-5;
/// Bytes of cages grow with this power of the number of vertices, and those of what they leave fall
/// with the other: around the rest poses of eleven captures with 0.7 to 0.9 and 0.2 to 1.
const CAGE_POWER: f64 = 0.85;
const RESIDUAL_POWER: f64 = 0.5;
/// Bytes of the residual over what its numbers take one by one around the rest pose: neighbours
/// predict each other, and designed cages leave less. Fitted to sizes of files; without any one
/// capture it is 0.30 to 0.37.
const RESIDUAL_SHARE: f64 = 0.3;
/// Steps of the residual, and of cages, over the largest error allowed.
const RESIDUAL_STEP: f64 = 1.8;
const CAGE_STEP: f64 = 2.9;

/// What the frames of a capture take in a file: of cages with ever more vertices, and of the
/// residual that these leave.
///
/// A number x in steps of q takes about `log₂(1 + |x|/q)` bits. The numbers are the principal
/// components over time of what a small cage around the rest pose leaves, and its own motion in an
/// orthonormal basis; from there on both follow powers of the number of vertices.
pub struct Rates {
    groups: Vec<Group>,
}

/// Numbers of points that one cage moves, for all points and frames.
struct Group {
    residual: Mat<f64>,
    cages: Mat<f64>,
    /// How many points one that was measured stands for.
    points: f64,
    /// By how much numbers are larger for all frames, over the diagonal of the whole model.
    scale: f64,
}

/// A number of vertices that suits an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuitedSize {
    /// The number with which frames take the fewest bytes.
    pub vertices: usize,
    /// About what cages take with the fewest vertices, in bytes.
    pub cages: f64,
    /// About what these leave to code.
    pub residual: f64,
}

impl Rates {
    /// Of evenly spaced frames of a capture of `total` ones.
    ///
    /// # Errors
    /// A rest pose that no small cage encloses.
    pub fn new(rest: &Model, frames: &[Vec<f64>], total: usize) -> Result<Self, EncloseError> {
        Ok(Self { groups: vec![Group::new(rest, frames, total, (MEASURED, 1.0))?] })
    }

    /// The same of parts that have a component each: rest poses, frames, vertices of the small cages,
    /// and diagonals over that of the whole.
    pub(crate) fn of_parts(
        parts: impl Iterator<Item = (Model, Vec<Vec<f64>>, (usize, f64))>,
        total: usize,
    ) -> Result<Self, EncloseError> {
        let groups = parts.map(|(rest, frames, size)| Group::new(&rest, &frames, total, size));
        Ok(Self { groups: groups.collect::<Result<_, _>>()? })
    }

    /// The size where no point may be off by more than this share of the diagonal.
    pub fn suited(&self, error: f64) -> SuitedSize {
        let sum = |of: fn(&Group, f64) -> f64| self.groups.iter().map(|group| of(group, error)).sum::<f64>() / 8.0;
        let (residual, cages) = (RESIDUAL_SHARE * sum(Group::residual_bits), sum(Group::cage_bits));
        // Where the sum of both powers is least.
        let ratio = RESIDUAL_POWER * residual / (CAGE_POWER * cages).max(f64::MIN_POSITIVE);
        let vertices = MEASURED as f64 * ratio.powf(1.0 / (CAGE_POWER + RESIDUAL_POWER));
        SuitedSize { vertices: (vertices.round() as usize).clamp(LEAST, MOST), cages, residual }
    }

    /// The size where frames may take so many bytes: that of the error which these allow.
    pub fn suited_to_bytes(&self, bytes: f64) -> SuitedSize {
        let (mut least, mut most) = (LEAST_ERROR.ln(), 0.0);
        for _ in 0..12 {
            let middle = 0.5 * (least + most);
            let SuitedSize { vertices, cages, residual } = self.suited(middle.exp());
            let times = vertices as f64 / MEASURED as f64;
            if cages * times.powf(CAGE_POWER) + residual * times.powf(-RESIDUAL_POWER) > bytes {
                least = middle;
            } else {
                most = middle;
            }
        }
        self.suited(most.exp())
    }
}

impl Group {
    fn new(
        rest: &Model,
        frames: &[Vec<f64>],
        total: usize,
        (vertices, size): (usize, f64),
    ) -> Result<Self, EncloseError> {
        let (samples, mesh) = rayon::join(
            || Samples::new(rest, frames, &Parts::of(frames.len()), &mut fastrand::Rng::with_seed(0)),
            || enclose(rest, &EncloseOptions { vertices, ..EncloseOptions::default() }),
        );
        let mesh = mesh?;
        let unusable = EncloseError::TooFewVertices { vertices, least: vertices + 1 };
        let cage = Cage::new(mesh).map_err(|_| unusable.clone())?;
        let phi = MeanValue.smooth_coordinates(&cage, &samples.judged_points);
        let gram = gram(to_double(phi.as_ref()).as_ref(), BLOCK_ROWS);
        let motion = samples.judged_motion.as_ref().subcols(0, samples.chosen_from);
        let fit = Fit::of_factor(phi.as_ref(), motion, || ridge_factor(gram, RIDGE)).ok_or(unusable)?;
        Ok(Self {
            residual: principal(&to_double(fit.residual.as_ref()), usize::MAX),
            // `‖Lᵀ C‖ = ‖Φ C‖`, but for the ridge.
            cages: fit.factor.transpose() * to_double(fit.cages.as_ref()),
            points: rest.points.len() as f64 / samples.judged_points.len() as f64,
            scale: size * (total as f64 / samples.judged_frames[0] as f64).sqrt(),
        })
    }

    fn residual_bits(&self, error: f64) -> f64 {
        self.points * bits(self.residual.as_ref(), self.scale / (RESIDUAL_STEP * error))
    }

    fn cage_bits(&self, error: f64) -> f64 {
        bits(self.cages.as_ref(), self.scale * self.points.sqrt() / (CAGE_STEP * error))
    }
}

fn bits(numbers: MatRef<'_, f64>, scale: f64) -> f64 {
    let of_column = |c: usize| numbers.col(c).iter().map(|x| (1.0 + (scale * x).abs()).log2()).sum::<f64>();
    (0..numbers.ncols()).map(of_column).sum()
}
