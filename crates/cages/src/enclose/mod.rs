//! A cage around a model, from its rest pose alone.

mod fair;
mod gap_offset;
mod gaps;
mod lattice;
mod level_set;
mod offset;
mod options;
mod patch;
mod push;
mod quadric;
mod simplify;
mod source;

use crate::thinned::Thinned;
use cager_geometry::mesh::{Model, TriMesh};
use cager_geometry::spatial::{Surface, self_intersections};
use fair::fair;
use gap_offset::Offset;
use glam::DVec3;
use lattice::Octree;
use offset::{offset_surface, offset_with_gaps, uniform_offset};
pub use options::{EncloseError, EncloseOptions};
use patch::EnclosedPoints;
use push::pushed_outwards;
use rayon::prelude::*;
use simplify::Simplifier;
use source::NormalizedModel;
use source::points_on_faces;
pub(crate) use source::{check_finite, extent, triangles};
use std::ops::ControlFlow;

/// A closed, outward-oriented cage around all of a model, free of self-intersection: an offset
/// surface, simplified under quadric error metrics with validity kept at every collapse. The offset
/// is smaller beside thin gaps, so that limbs stay apart, and grows until the number of vertices is
/// reached. Gaps stay closed in a point cloud and where there are too many narrow ones. Runs on the
/// current rayon pool; the result does not depend on it.
///
/// # Errors
/// See [`EncloseError`].
pub fn enclose(model: &Model, options: &EncloseOptions) -> Result<TriMesh, EncloseError> {
    enclose_watched(model, options, &mut || ControlFlow::Continue(()))
}

/// [`enclose`], given up once `watch` breaks; it is called every few hundredths of a second.
///
/// # Errors
/// See [`EncloseError`].
pub fn enclose_watched(
    model: &Model,
    options: &EncloseOptions,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<TriMesh, EncloseError> {
    check_finite(&model.points)?;
    let (.., diagonal) = extent(&model.points)?;
    if let Some(thin) = Thinned::of(model) {
        match enclose_all(&thin.model(model), options, watch) {
            Err(EncloseError::Stopped) => return Err(EncloseError::Stopped),
            Err(_) => {}
            Ok(cage) => {
                let mut inside = model.points.clone();
                inside.extend(points_on_faces(model, diagonal * first_offset(options.vertices)));
                if let Some(cage) = pushed_outwards(cage, &inside, clearance(options), diagonal) {
                    return Ok(cage);
                }
            }
        }
    }
    enclose_all(model, options, watch)
}

/// Clearance asked for, as a fraction of the diagonal.
fn clearance(options: &EncloseOptions) -> f64 {
    options.clearance.filter(|c| c.is_finite()).unwrap_or(0.0).clamp(0.0, MAX_CLEARANCE)
}

/// [`enclose_watched`] by all points of a model.
fn enclose_all(
    model: &Model,
    options: &EncloseOptions,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<TriMesh, EncloseError> {
    let clearance = clearance(options);
    let mut offset = first_offset(options.vertices).max(2.0 * clearance);
    let source = NormalizedModel::new(model, offset)?;
    if options.vertices < MIN_VERTICES {
        return Err(EncloseError::TooFewVertices { vertices: options.vertices, least: MIN_VERTICES });
    }
    let mut least = usize::MAX;
    // Surfaces that are known already, the next to be tried last, once narrow gaps proved too many.
    let mut known: Option<Vec<Start>> = None;
    while offset < MAX_OFFSET.max(4.0 * clearance) {
        if watch().is_break() {
            return Err(EncloseError::Stopped);
        }
        let start = match &mut known {
            Some(known) => known.pop().unwrap_or_else(|| Start::with_gaps_closed(&source, offset, options)),
            None => match Start::with_gaps_open(&source, offset, clearance, options) {
                Some(start) => start,
                None => {
                    let promising = promising_starts(&source, offset, options);
                    offset = promising.last().map_or(offset, |start| start.offset.largest);
                    known = Some(promising);
                    continue;
                }
            },
        };
        match enclose_from(&source, start, clearance, options, watch) {
            Ok(cage) => return Ok(cage),
            Err(reached) => least = least.min(reached),
        }
        offset *= GROWTH;
    }
    let too_few = EncloseError::TooFewVertices { vertices: options.vertices, least };
    simple_shape(&source, options.vertices, clearance).ok_or(too_few)
}

/// How many times larger the next offset is that is tried.
const GROWTH: f64 = 1.35;

/// From this offset on a lattice is so coarse that a surface takes no time.
const COARSE: f64 = 0.04;

/// What a cage is simplified from.
struct Start {
    offset: Offset,
    /// At the offset, if it has no more parts and handles than the cage has vertices for.
    surface: Option<(Vec<DVec3>, Vec<[u32; 3]>)>,
}

impl Start {
    /// `None` where gaps prove too many to be kept open.
    fn with_gaps_open(source: &NormalizedModel, offset: f64, clearance: f64, options: &EncloseOptions) -> Option<Self> {
        let (offset, cubes) = offset_with_gaps(source, offset, 2.0 * clearance, most_halved(options.vertices))?;
        Some(Self { surface: promising_surface(source, &offset, &cubes, options), offset })
    }

    fn with_gaps_closed(source: &NormalizedModel, offset: f64, options: &EncloseOptions) -> Self {
        let (offset, cubes) = uniform_offset(source, offset);
        Self { surface: promising_surface(source, &offset, &cubes, options), offset }
    }
}

/// Offsets whose surfaces few enough vertices may enclose, gaps closed; the least comes last. Small
/// offsets of models with many narrow gaps take the longest, so they are looked at from a large one
/// down.
fn promising_starts(source: &NormalizedModel, first: f64, options: &EncloseOptions) -> Vec<Start> {
    let mut offsets = vec![first];
    while offsets[offsets.len() - 1] < COARSE {
        offsets.push(GROWTH * offsets[offsets.len() - 1]);
    }
    let mut found: Vec<Start> = Vec::new();
    for offset in offsets.into_iter().rev() {
        let start = Start::with_gaps_closed(source, offset, options);
        let is_promising = start.surface.is_some();
        if is_promising || found.is_empty() {
            found.push(start);
        }
        if !is_promising {
            break;
        }
    }
    found
}

/// The surface at an offset, if it has no more parts and handles than the cage has vertices for.
fn promising_surface(
    source: &NormalizedModel,
    offset: &Offset,
    cubes: &Octree,
    options: &EncloseOptions,
) -> Option<(Vec<DVec3>, Vec<[u32; 3]>)> {
    let most_parts = options.vertices / if options.per_part { MIN_VERTICES } else { VERTICES_PER_PART };
    let (positions, faces) = offset_surface(source, offset, cubes, options.per_part, most_parts.max(1))?;
    // A closed surface of V vertices and F faces has V − F/2 = 2 (components − handles).
    let handles = (faces.len() / 2).saturating_sub(positions.len());
    (handles * VERTICES_PER_PART <= options.vertices).then_some((positions, faces))
}

/// Vertices of the least closed surface.
const MIN_VERTICES: usize = 4;

/// Least vertices of a component or handle; with fewer, a larger offset is tried at once.
const VERTICES_PER_PART: usize = 6;

/// Largest offset tried, as a fraction of the diagonal.
const MAX_OFFSET: f64 = 1.0;

/// Larger clearances are taken as this, a fraction of the diagonal.
const MAX_CLEARANCE: f64 = 10.0;

/// Clearance kept where none is asked for, as a fraction of the offset.
const DEFAULT_CLEARANCE: f64 = 0.2;

/// Small offsets keep limbs apart, large ones need few vertices: 1.2 % suits 350 vertices.
fn first_offset(vertices: usize) -> f64 {
    (0.012 * (350.0 / vertices as f64).powf(0.45)).clamp(0.009, 0.06)
}

/// Cubes that may be halved to keep gaps open; a finer surface would take too long to simplify.
fn most_halved(vertices: usize) -> usize {
    (1_200 + 3 * vertices).min(2_500)
}

/// A valid cage simplified from a surface, or the vertices that were left; `usize::MAX` of none.
fn enclose_from(
    source: &NormalizedModel,
    Start { offset, surface }: Start,
    clearance: f64,
    options: &EncloseOptions,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<TriMesh, usize> {
    let (positions, faces) = surface.ok_or(usize::MAX)?;
    let kept = |p: DVec3| clearance.max(DEFAULT_CLEARANCE * offset.at(p));
    let (samples, clearances) = source.samples(&offset, kept);
    let enclosed = EnclosedPoints::new(samples, clearances);
    let mut simplifier = Simplifier::new(positions, faces, &enclosed);
    if !simplifier.simplify(options.vertices, watch) {
        return Err(simplifier.len());
    }
    fair(&mut simplifier.mesh, &simplifier.quadrics, &enclosed);
    let (used, triangles) = simplifier.mesh.compacted();
    let positions: Vec<DVec3> = used.iter().map(|&v| simplifier.mesh.positions[v as usize]).collect();
    verified(source, &positions, triangles, clearance).ok_or(usize::MAX)
}

/// The cage in the model's frame of reference, if it is valid there.
fn verified(
    source: &NormalizedModel,
    positions: &[DVec3],
    triangles: Vec<[u32; 3]>,
    clearance: f64,
) -> Option<TriMesh> {
    let surface = Surface::new(positions.to_vec(), triangles.clone());
    let encloses = |&p: &DVec3| surface.contains(p) && surface.distance_within(p, clearance).is_none();
    let vertices = positions.iter().map(|&p| source.restored(p)).collect();
    let cage = TriMesh { vertices, triangles };
    (source.points.par_iter().with_min_len(256).all(encloses) && self_intersections(&cage).is_empty()).then_some(cage)
}

/// A box, octahedron or tetrahedron around the model.
fn simple_shape(source: &NormalizedModel, vertices: usize, clearance: f64) -> Option<TriMesh> {
    let bounds = source.surface.tree.bounds().grown(clearance + 0.02);
    let (center, half) = (bounds.center(), 0.5 * bounds.size());
    let (corners, triangles): (Vec<DVec3>, Vec<[u32; 3]>) = if vertices >= 8 {
        let sign = |i: usize, k: usize| if i >> k & 1 == 0 { -1.0 } else { 1.0 };
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let halves = |q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]];
        (
            (0..8).map(|i| DVec3::new(sign(i, 0), sign(i, 1), sign(i, 2))).collect(),
            quads.iter().flat_map(halves).collect(),
        )
    } else {
        let corners = [[3.0, 3.0, 3.0], [3.0, -3.0, -3.0], [-3.0, 3.0, -3.0], [-3.0, -3.0, 3.0]];
        (corners.map(DVec3::from).to_vec(), vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    };
    let positions: Vec<DVec3> = corners.iter().map(|&c| center + half * c).collect();
    verified(source, &positions, triangles, clearance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_geometry::mesh::Polygons;

    /// Square pipes along all axes, some hundred of them, which meet and leave holes between them.
    fn pipes(along: u32) -> Model {
        let (mut points, mut faces) = (Vec::new(), Polygons::new());
        let half = 0.15 / f64::from(along);
        let places = (0..along * along).map(|k| (k / along, k % along));
        for (axis, (i, j)) in (0..3).flat_map(|axis| places.clone().map(move |place| (axis, place))) {
            let first = points.len() as u32;
            for end in [0.0, 1.0] {
                for [u, v] in [[-half, -half], [half, -half], [half, half], [-half, half]] {
                    let mut p = [end; 3];
                    p[(axis + 1) % 3] = (f64::from(i) + 0.5) / f64::from(along) + u;
                    p[(axis + 2) % 3] = (f64::from(j) + 0.5) / f64::from(along) + v;
                    points.push(p);
                }
            }
            (0..4).for_each(|k| faces.push(&[k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k].map(|v| first + v)));
        }
        Model { points, faces, ..Model::default() }
    }

    #[test]
    fn a_tangle_is_enclosed_at_the_least_offset_that_will_do_and_smaller_ones_are_not_tried() {
        let options = EncloseOptions::default();
        let first = first_offset(options.vertices);
        let source = NormalizedModel::new(&pipes(6), first).unwrap();
        assert!(Start::with_gaps_open(&source, first, 0.0, &options).is_none());
        let mut starts = promising_starts(&source, first, &options);
        let found = starts.last().unwrap().offset.largest;
        assert!(found > 1.3 * first);
        assert!(Start::with_gaps_closed(&source, found / GROWTH, &options).surface.is_none());
        assert!(starts.windows(2).all(|two| two[0].offset.largest > two[1].offset.largest));
        assert!(enclose_from(&source, starts.pop().unwrap(), 0.0, &options, &mut || ControlFlow::Continue(())).is_ok());
    }
}
