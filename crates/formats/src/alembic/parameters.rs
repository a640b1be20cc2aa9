//! Parameters of a mesh: values by corner, point or face, with indices or without.

use cager_geometry::surface::CornerSet;

use super::objects::{Archive, told};
use super::properties::{F32, Kind, Property, U32, find};
use crate::error::Fault;
use crate::scene::{Values, merged};

/// How many points a mesh has, the corners of its faces, and how many each face has.
pub(super) struct Topology {
    pub(super) points: usize,
    pub(super) corners: Vec<u32>,
    pub(super) arities: Vec<u32>,
}

impl Archive<'_> {
    /// A parameter of `N` numbers of single precision, in its first sample; none where it has others,
    /// or does not fit the mesh.
    pub(super) fn parameter<const N: usize>(
        &mut self,
        parameter: &Property,
        topology: &Topology,
    ) -> Result<Option<CornerSet<N>>, Fault> {
        let inner = if parameter.kind == Kind::Compound { self.properties(parameter.group)? } else { Vec::new() };
        let Some(values) = find(&inner, ".vals", Kind::Array).or(Some(parameter)).filter(|values| {
            (values.kind, values.number, usize::from(values.extent)) == (Kind::Array, F32, N) && values.samples > 0
        }) else {
            return Ok(None);
        };
        let first = values.first(&mut self.container)?;
        let values = self.container.vectors(first)?;
        let indices = find(&inner, ".indices", Kind::Array).filter(|found| found.number == U32 && found.samples > 0);
        let indices = match indices {
            Some(indices) => {
                let first = indices.first(&mut self.container)?;
                self.container.integers(first, u64::MAX)?.into_iter().map(|index| index as u32).collect()
            }
            None => (0..values.len() as u32).collect(),
        };
        let scope = told(&parameter.metadata, b"geoScope").unwrap_or_default();
        let corners = topology.by_corner(scope, indices);
        let name = told(&parameter.metadata, b"sourceName").unwrap_or(&parameter.name);
        let fits = corners.filter(|corners| corners.iter().all(|&k| (k as usize) < values.len()));
        Ok(fits.map(|corners| merged(String::from_utf8_lossy(name).into_owned(), &values, corners)))
    }
}

impl Topology {
    /// What each corner has of what points, faces or corners have.
    fn by_corner(&self, scope: &[u8], indices: Vec<u32>) -> Option<Vec<u32>> {
        let of_points = |indices: &[u32]| self.corners.iter().map(|&k| indices.get(k as usize).copied()).collect();
        let count = indices.len();
        match scope {
            b"vtx" | b"var" if count == self.points => of_points(&indices),
            b"uni" if count == self.arities.len() => {
                let of_face = |(&index, &arity)| std::iter::repeat_n(index, arity as usize);
                Some(indices.iter().zip(&self.arities).flat_map(of_face).collect())
            }
            b"con" if count == 1 => Some(vec![indices[0]; self.corners.len()]),
            b"vtx" | b"var" | b"uni" | b"con" => None,
            _ if count == self.corners.len() => Some(indices),
            // Where a program does not say what has them.
            b"" if count == self.points => of_points(&indices),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_faces_corners_or_the_whole_have_values() {
        // A triangle and an edge, of four points.
        let topology = Topology { points: 4, corners: vec![2, 1, 0, 3, 0], arities: vec![3, 2] };
        let by = |scope: &[u8], count: u32| topology.by_corner(scope, (10..10 + count).collect());
        assert_eq!(by(b"fvr", 5), Some(vec![10, 11, 12, 13, 14]));
        assert_eq!((by(b"vtx", 4), by(b"var", 4)), (Some(vec![12, 11, 10, 13, 10]), Some(vec![12, 11, 10, 13, 10])));
        assert_eq!(by(b"uni", 2), Some(vec![10, 10, 10, 11, 11]));
        assert_eq!(by(b"con", 1), Some(vec![10; 5]));
        assert_eq!((by(b"", 5), by(b"", 4)), (by(b"fvr", 5), by(b"vtx", 4)));
        for (scope, count) in [(&b"fvr"[..], 4), (b"vtx", 5), (b"uni", 3), (b"con", 2), (b"", 2)] {
            assert_eq!(by(scope, count), None, "{count}");
        }
    }
}
