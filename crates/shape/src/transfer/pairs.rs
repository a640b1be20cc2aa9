//! Vertices of source and target that correspond: never needed, but they pull the alignment and the
//! registration.

use cager_geometry::mesh::Point;
use glam::DVec3;

use crate::error::TransferError;
use crate::points::Moments;
use crate::similarity::Similarity;

/// A vertex of the source and the vertex of the target that lies at the same place of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VertexPair {
    /// The source's vertex, from 0.
    pub source: u32,
    /// The target's vertex, from 0.
    pub target: u32,
}

/// Fewer pairs, or pairs on a line, only choose among the alignments of the surfaces.
const DETERMINED: usize = 3;
/// Pairs lie on a line where their second principal extent is below this share of the first.
const LINE: f64 = 1e-2;

/// Pairs with their places at rest.
#[derive(Default)]
pub(crate) struct Pairs {
    /// Of the source.
    pub(crate) vertices: Vec<u32>,
    /// In the source's space, in the target's, and a weight of one.
    pub(crate) places: Vec<(DVec3, DVec3, f64)>,
}

impl Pairs {
    /// Pairs of a source and a target with these points.
    ///
    /// # Errors
    /// A vertex that there is not.
    pub(crate) fn new(pairs: &[VertexPair], source: &[Point], target: &[Point]) -> Result<Self, TransferError> {
        let at = |pair: usize, whose: &'static str, vertex: u32, points: &[Point]| {
            let missing = TransferError::Pair { pair, whose, vertex, points: points.len() };
            points.get(vertex as usize).map(|&p| DVec3::from(p)).ok_or(missing)
        };
        let place = |(k, pair): (usize, &VertexPair)| {
            Ok((at(k, "source", pair.source, source)?, at(k, "target", pair.target, target)?, 1.0))
        };
        let places = pairs.iter().enumerate().map(place).collect::<Result<_, TransferError>>()?;
        Ok(Self { vertices: pairs.iter().map(|pair| pair.source).collect(), places })
    }

    /// Whether they determine an alignment alone.
    pub(crate) fn determine(&self) -> bool {
        let (from, to): (Vec<DVec3>, Vec<DVec3>) = self.places.iter().map(|&(p, q, _)| (p, q)).unzip();
        self.places.len() >= DETERMINED && spread(&from) && spread(&to)
    }

    /// Sum of the squared distances between the places, the source's moved.
    pub(crate) fn apart(&self, by: &Similarity) -> f64 {
        self.places.iter().map(|&(p, q, _)| by.apply(p).distance_squared(q)).sum()
    }
}

/// Whether points lie on no line.
fn spread(points: &[DVec3]) -> bool {
    let variances = Moments::new(points).variances;
    variances[1] > LINE * LINE * variances[0]
}
