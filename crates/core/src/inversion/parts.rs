//! Conversion of a solver to and from plain arrays, for storage.

use super::consistent::Consistent;
use super::nearness::{Nearness, NearnessParts};
use super::{PreparationReport, RegularizationTarget, Solver};
use crate::batch::padded_to_tiles;
use crate::coordinates::DependentNormals;
use crate::decode::Decoder;
use faer::{Mat, MatRef};
use std::sync::Arc;

/// The data of a solver as plain arrays.
#[derive(Clone, Debug)]
pub struct SolverParts {
    /// Indices of the points read; of all points, those of maximum volume, if they were chosen.
    pub handles: Vec<u32>,
    /// Whether the inversion reads every point instead of the handles.
    pub reads_all: bool,
    /// `Rᵀ`, K × m: one row per point read.
    pub operator: Mat<f64>,
    /// Contribution of the reference cage, added to `R · H`.
    pub target: RegularizationTarget,
    /// `Φ`, n × columns.
    pub phi: Mat<f32>,
    /// Number of columns that multiply vertices; they come first.
    pub positions: usize,
    /// Additional data of the consistent inversion, where normals are functions of the vertices.
    pub dependent: Option<DependentParts>,
    /// What brings cages back to their frames, where a term holds them.
    pub nearness: Option<NearnessParts>,
    /// Diagonal of the rest pose's bounding box.
    pub diagonal: f64,
    /// Results of the preparation.
    pub preparation: PreparationReport,
}

/// Data of the consistent inversion.
#[derive(Clone, Debug)]
pub struct DependentParts {
    /// How normals are computed from the vertices.
    pub normals: DependentNormals,
    /// `(v/K) ΦᵀΦ` of the K points read, for v vertices; columns × columns.
    pub gram: Mat<f64>,
    /// Weight λ of the regularisation towards the linear start.
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

    /// Contribution of the reference cage, added to `R · H`.
    pub fn regularization_target(&self) -> &RegularizationTarget {
        &self.target
    }

    /// The normals' definition, the Gram matrix of the rows read, and the linear start's weight λ.
    pub fn dependent(&self) -> Option<(&DependentNormals, MatRef<'_, f64>, f64)> {
        let consistent = self.consistent.as_ref()?;
        Some((self.decoder.dependent_normals()?, consistent.gram(), consistent.weight()))
    }

    /// What brings cages back to their frames, if anything does.
    pub fn nearness(&self) -> Option<&NearnessParts> {
        self.nearness.as_ref().map(|nearness| nearness.parts())
    }

    /// The same solver, whose cages go where the data take them.
    #[must_use]
    pub fn without_nearness(self) -> Self {
        Self { nearness: None, ..self }
    }

    /// A solver with bit-identical results; `None` where the parts are inconsistent.
    pub fn from_parts(parts: SolverParts) -> Option<Self> {
        let SolverParts {
            handles,
            reads_all,
            operator,
            target,
            phi,
            positions,
            dependent,
            nearness,
            diagonal,
            preparation,
        } = parts;
        let (n, columns) = phi.shape();
        let m = if dependent.is_some() { positions } else { columns };
        let fits = (1..=n).contains(&m)
            && (1..=columns).contains(&positions)
            && operator.ncols() == m
            && operator.nrows() == if reads_all { n } else { handles.len() }
            && (reads_all || (1..=n).contains(&handles.len()))
            && handles.iter().all(|&h| (h as usize) < n)
            && target.fits(m)
            && dependent.as_ref().is_none_or(|dependent| dependent.fits(columns, positions))
            && diagonal.is_finite();
        if !fits {
            return None;
        }
        let mut decoder = Decoder::from_single(phi, positions);
        let mut consistent = None;
        if let Some(DependentParts { normals, gram, weight }) = dependent {
            decoder = decoder.with_dependent_normals(Some(normals));
            let rows = (!reads_all).then_some(handles.as_slice());
            consistent = Some(Arc::new(Consistent::from_gram(&decoder, rows, weight, gram)?));
        }
        let nearness = match nearness {
            Some(parts) => Some(Arc::new(Nearness::from_parts(parts).filter(|nearness| nearness.unknowns() == m)?)),
            None => None,
        };
        let operator = padded_to_tiles(operator);
        Some(Self { handles, reads_all, operator, target, consistent, nearness, decoder, diagonal, preparation })
    }
}

impl DependentParts {
    fn fits(&self, columns: usize, positions: usize) -> bool {
        positions + self.normals.faces().len() == columns
            && self.normals.faces().iter().flatten().all(|&v| (v as usize) < positions)
            && self.gram.shape() == (columns, columns)
            && self.weight.is_finite()
    }
}
