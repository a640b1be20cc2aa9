//! Vertices of source and target that are known to correspond: never needed, but they pull the alignment and the registration where there are some.

use cager_geometry::mesh::Point;
use glam::DVec3;

use crate::error::TransferError;
use crate::points::Moments;

/// A vertex of the source and the vertex of the target that lies at the same place of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VertexPair {
    /// The source's vertex, from 0.
    pub source: u32,
    /// The target's vertex, from 0.
    pub target: u32,
}

/// Fewer pairs, or pairs on a line, do not determine an alignment; they choose among those that the surfaces offer.
const DETERMINED: usize = 3;
/// Pairs lie on a line where their second principal extent is below this share of the first.
const LINE: f64 = 1e-2;

/// Pairs with their places at rest, source and target each in its own space.
#[derive(Default)]
pub(crate) struct Pairs {
    pub(crate) vertices: Vec<u32>,
    pub(crate) from: Vec<DVec3>,
    pub(crate) to: Vec<DVec3>,
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
        let mut found = Self::default();
        for (k, pair) in pairs.iter().enumerate() {
            found.vertices.push(pair.source);
            found.from.push(at(k, "source", pair.source, source)?);
            found.to.push(at(k, "target", pair.target, target)?);
        }
        Ok(found)
    }

    /// Whether they determine an alignment alone.
    pub(crate) fn determine(&self) -> bool {
        self.from.len() >= DETERMINED && spread(&self.from) && spread(&self.to)
    }

    /// Their places.
    pub(crate) fn places(&self) -> Vec<(Point, Point)> {
        self.from.iter().zip(&self.to).map(|(p, q)| (p.to_array(), q.to_array())).collect()
    }

    /// Sum of the squared distances between the places, the source's moved by `moved`.
    pub(crate) fn apart(&self, moved: impl Fn(DVec3) -> DVec3) -> f64 {
        self.from.iter().zip(&self.to).map(|(&p, &q)| moved(p).distance_squared(q)).sum()
    }
}

/// Whether points lie on no line.
fn spread(points: &[DVec3]) -> bool {
    let variances = Moments::new(points).variances;
    variances[1] > LINE * LINE * variances[0]
}
