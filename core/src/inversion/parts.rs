//! A solver's numbers, for keeping it between runs.

use super::{Preparation, Pull, Solver};
use crate::decode::Decoder;
use faer::{Mat, MatRef};

/// Everything a solver is made of, as plain numbers.
#[derive(Clone, Debug)]
pub struct SolverParts {
    /// The rows read, or where every point is, those of maximum volume.
    pub handles: Vec<u32>,
    /// Whether the inversion reads every point instead of the handles.
    pub reads_all: bool,
    /// `Rᵀ`, K × m: one row per point read.
    pub operator: Mat<f64>,
    /// What is added to `R · H`.
    pub pull: Pull,
    /// `Φ`, n × m.
    pub phi: Mat<f32>,
    /// Unknowns that are positions and follow a translation; they come first.
    pub positions: usize,
    /// Diagonal of the rest pose's bounding box.
    pub diagonal: f64,
    /// What preparing found out.
    pub preparation: Preparation,
}

impl Solver {
    /// `Rᵀ`, K × m: one row per point read.
    pub fn operator(&self) -> MatRef<'_, f64> {
        self.operator.as_ref().subcols(0, self.decoder.unknowns())
    }

    /// Whether the inversion reads every point instead of the handles.
    pub fn reads_all(&self) -> bool {
        self.reads_all
    }

    /// What is added to `R · H`.
    pub fn pull(&self) -> &Pull {
        &self.pull
    }

    /// Puts a solver together again; it gives the same bits as the one its parts were taken from. None where the parts do not
    /// fit together.
    pub fn from_parts(parts: SolverParts) -> Option<Self> {
        let SolverParts { handles, reads_all, operator, pull, phi, positions, diagonal, preparation } = parts;
        let (n, m) = phi.shape();
        let fits = (1..=n).contains(&m)
            && (1..=m).contains(&positions)
            && operator.ncols() == m
            && operator.nrows() == if reads_all { n } else { handles.len() }
            && (1..=n).contains(&handles.len())
            && handles.iter().all(|&h| (h as usize) < n)
            && pull.fits(m)
            && diagonal.is_finite();
        fits.then(|| Self {
            handles,
            reads_all,
            operator: super::operator::with_whole_tiles(operator),
            pull,
            decoder: Decoder::from_single(phi, positions),
            diagonal,
            preparation,
        })
    }
}
