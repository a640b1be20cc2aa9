//! A solver's numbers, for keeping it between runs.

use super::consistent::Consistent;
use super::{Preparation, Pull, Solver};
use crate::coordinates::TiedNormals;
use crate::decode::Decoder;
use faer::{Mat, MatRef};
use std::sync::Arc;

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
    /// `Φ`, n × columns.
    pub phi: Mat<f32>,
    /// Columns of positions, which follow a translation; they come first.
    pub positions: usize,
    /// Where normals follow from vertices, what inverting takes beside the operator.
    pub tied: Option<TiedParts>,
    /// Diagonal of the rest pose's bounding box.
    pub diagonal: f64,
    /// What preparing found out.
    pub preparation: Preparation,
}

/// What a solver is made of where normals follow from vertices.
#[derive(Clone, Debug)]
pub struct TiedParts {
    /// The rule by which they do.
    pub normals: TiedNormals,
    /// The Gram matrix of the rows read, columns × columns.
    pub gram: Mat<f64>,
    /// How much the shape of the linear start counts.
    pub weight: f64,
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

    /// Where normals follow from vertices: the rule, the Gram matrix of the rows read, columns × columns, and how much the shape of
    /// the linear start counts.
    pub fn tied(&self) -> Option<(&TiedNormals, MatRef<'_, f64>, f64)> {
        let consistent = self.consistent.as_ref()?;
        Some((self.decoder.tied_normals()?, consistent.gram(), consistent.weight()))
    }

    /// Puts a solver together again; it gives the same bits as the one its parts were taken from. None where the parts do not
    /// fit together.
    pub fn from_parts(parts: SolverParts) -> Option<Self> {
        let SolverParts { handles, reads_all, operator, pull, phi, positions, tied, diagonal, preparation } = parts;
        let (n, columns) = phi.shape();
        let m = if tied.is_some() { positions } else { columns };
        let fits = (1..=n).contains(&m)
            && (1..=columns).contains(&positions)
            && operator.ncols() == m
            && operator.nrows() == if reads_all { n } else { handles.len() }
            && (1..=n).contains(&handles.len())
            && handles.iter().all(|&h| (h as usize) < n)
            && pull.fits(m)
            && tied.as_ref().is_none_or(|tied| tied.fits(columns, positions))
            && diagonal.is_finite();
        if !fits {
            return None;
        }
        let mut decoder = Decoder::from_single(phi, positions);
        let mut consistent = None;
        if let Some(TiedParts { normals, gram, weight }) = tied {
            decoder = decoder.with_tied_normals(Some(normals));
            let rows = (!reads_all).then_some(handles.as_slice());
            consistent = Some(Arc::new(Consistent::from_gram(&decoder, rows, weight, gram)?));
        }
        let operator = super::operator::with_whole_tiles(operator);
        Some(Self { handles, reads_all, operator, pull, consistent, decoder, diagonal, preparation })
    }
}

impl TiedParts {
    fn fits(&self, columns: usize, positions: usize) -> bool {
        positions + self.normals.faces().len() == columns
            && self.normals.faces().iter().flatten().all(|&v| (v as usize) < positions)
            && self.gram.shape() == (columns, columns)
            && self.weight.is_finite()
    }
}
