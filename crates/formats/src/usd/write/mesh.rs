//! One mesh of a layer, and its frames.

use std::io::{self, Seek, Write};
use std::ops::Range;

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{Part, PartRange, SharedNormals, Subdivision};

use super::encoder::Encoder;
use super::faces;
use super::property::{Prim, Property};
use crate::scene::bounds;

/// Values of what is written of a mesh.
#[derive(Default)]
pub(super) struct Mesh {
    /// Which points of the model it has.
    points: Range<usize>,
    /// How many corners faces have, and which.
    faces: [u64; 2],
    scheme: Subdivision,
    /// Programs show it and do not render it.
    pub(super) is_guide: bool,
    normals: Option<Normals>,
    /// Frames in which it is seen, if not in all.
    shown: Option<Vec<Range<u32>>>,
    /// What does not change, and sets of faces.
    fixed: Vec<Property>,
    subsets: Vec<Prim>,
    /// Of each frame.
    positions: Vec<u64>,
    extents: Vec<u64>,
    directions: Vec<u64>,
}

/// How normals are written.
struct Normals {
    shared: SharedNormals,
    /// Which of them points have, where those of all corners are one.
    of_points: Option<Vec<u32>>,
}

impl Mesh {
    /// Of some points of the model, and faces that count these.
    pub(super) fn new<W: Write + Seek>(
        encoder: &mut Encoder<W>,
        range: &PartRange,
        faces: &Polygons,
    ) -> io::Result<Self> {
        let counts: Vec<i32> = faces.arities().iter().map(|&count| count as i32).collect();
        let corners: Vec<i32> = faces.indices().iter().map(|&corner| corner as i32).collect();
        let faces = [encoder.integers(&counts)?, encoder.integers(&corners)?];
        Ok(Self { points: range.points.clone(), faces, ..Self::default() })
    }

    /// Of a part, whose materials have these paths.
    pub(super) fn of_part<W: Write + Seek>(
        encoder: &mut Encoder<W>,
        part: &Part,
        range: &PartRange,
        faces: &Polygons,
        materials: &[String],
    ) -> io::Result<Self> {
        let (fixed, subsets) = faces::put(encoder, part, materials)?;
        // What is subdivided has those of the limit.
        let has_normals = !part.normals.is_empty() && part.subdivision == Subdivision::None;
        let normals = has_normals.then(|| Normals::new(part, faces));
        let (scheme, shown) = (part.subdivision, part.shown.clone());
        Ok(Self { scheme, shown, fixed, subsets, normals, ..Self::new(encoder, range, faces)? })
    }

    /// Of a part of which the points alone are written, and normals where it has some.
    pub(super) fn moved<W: Write + Seek>(
        encoder: &mut Encoder<W>,
        part: &Part,
        range: &PartRange,
        faces: &Polygons,
        has_normals: bool,
    ) -> io::Result<Self> {
        let bare = Part {
            normals: if has_normals { part.normals.clone() } else { Vec::new() },
            tilts: part.tilts.clone().filter(|_| has_normals),
            weights: part.weights,
            points: part.points,
            subdivision: part.subdivision,
            ..Part::default()
        };
        Self::of_part(encoder, &bare, range, faces, &[])
    }

    /// What changes with the frames, when all are written at these times.
    pub(super) fn moved_properties<W: Write + Seek>(
        &self,
        encoder: &mut Encoder<W>,
        times: u64,
    ) -> io::Result<Vec<Property>> {
        let positions = encoder.samples(times, &self.positions)?;
        let extents = encoder.samples(times, &self.extents)?;
        // Readers without a time take the first frame.
        let first = self.positions.first().copied().unwrap_or_default();
        let mut properties = vec![
            Property::new("float3[]", "extent").samples(extents),
            Property::new("point3f[]", "points").value(first).samples(positions),
        ];
        if let Some(normals) = &self.normals {
            let first = self.directions.first().copied().unwrap_or_default();
            let samples = encoder.samples(times, &self.directions)?;
            let by = if normals.of_points.is_some() { "vertex" } else { "faceVarying" };
            properties.push(Property::new("normal3f[]", "normals").value(first).samples(samples).by(by));
        }
        Ok(properties)
    }

    /// Bytes of a frame.
    pub(super) fn frame_size(&self) -> usize {
        12 * (self.points.len() + self.normals.as_ref().map_or(0, Normals::len)) + 96
    }

    /// Writes a frame of the model.
    pub(super) fn write_frame<W: Write + Seek>(
        &mut self,
        encoder: &mut Encoder<W>,
        model: &[[f32; 3]],
    ) -> io::Result<()> {
        let points = model.get(self.points.clone()).unwrap_or_default();
        self.positions.push(encoder.floats(points)?);
        let extent = if points.is_empty() { [[0.0; 3]; 2] } else { bounds(points.as_flattened()) };
        self.extents.push(encoder.floats(&extent)?);
        if let Some(normals) = &self.normals {
            self.directions.push(encoder.floats(&normals.at(points))?);
        }
        Ok(())
    }

    /// The prim, when all frames are written at these times; `codes` are those of the frames.
    pub(super) fn prim<W: Write + Seek>(
        &mut self,
        encoder: &mut Encoder<W>,
        name: String,
        times: u64,
        codes: &[f64],
    ) -> io::Result<Prim> {
        let mut properties = self.moved_properties(encoder, times)?;
        let [counts, corners] = self.faces;
        let faces = [
            Property::new("int[]", "faceVertexCounts").value(counts),
            Property::new("int[]", "faceVertexIndices").value(corners),
        ];
        properties.splice(1..1, faces);
        // Otherwise programs subdivide it.
        properties.insert(4, Property::fixed("subdivisionScheme", faces::scheme(self.scheme)));
        if self.is_guide {
            properties.insert(5, Property::fixed("purpose", "guide"));
        }
        if let Some(shown) = &self.shown {
            let samples = visibility(encoder, shown, codes)?;
            properties.push(Property::new("token", "visibility").samples(samples));
        }
        properties.append(&mut self.fixed);
        let is_bound = properties.iter().any(Property::is_relationship);
        Ok(Prim { name, type_name: "Mesh", is_bound, properties, children: std::mem::take(&mut self.subsets) })
    }
}

/// Samples where a mesh is shown or hidden again.
fn visibility<W: Write + Seek>(encoder: &mut Encoder<W>, shown: &[Range<u32>], codes: &[f64]) -> io::Result<u64> {
    let starts = std::iter::once(0).chain(shown.iter().flat_map(|range| [range.start, range.end]));
    let mut frames: Vec<u32> = starts.filter(|&frame| (frame as usize) < codes.len()).collect();
    frames.sort_unstable();
    frames.dedup();
    let is_shown = |frame: &u32| {
        let before = &shown[..shown.partition_point(|range| range.start <= *frame)];
        before.last().is_some_and(|range| range.contains(frame))
    };
    let words = frames.iter().map(|frame| if is_shown(frame) { "inherited" } else { "invisible" });
    let values: Vec<u64> = words.map(|word| encoder.token(word)).collect();
    let at: Vec<f64> = frames.iter().map(|&frame| codes[frame as usize]).collect();
    let times = encoder.times(&at)?;
    encoder.samples(times, &values)
}

impl Normals {
    fn new(part: &Part, faces: &Polygons) -> Self {
        let shared = SharedNormals::of(part, faces.clone());
        let of_points = (!part.has_hard_edges(faces.indices())).then(|| {
            let mut of_points = vec![u32::MAX; part.points];
            for (&point, &normal) in faces.indices().iter().zip(&shared.corners) {
                of_points[point as usize] = normal;
            }
            of_points
        });
        Self { shared, of_points }
    }

    /// Those of points or of corners.
    fn numbers(&self) -> &[u32] {
        self.of_points.as_ref().unwrap_or(&self.shared.corners)
    }

    fn len(&self) -> usize {
        self.numbers().len()
    }

    /// Where points are; zero where no face has an area.
    fn at(&self, points: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let normals = self.shared.at(|point| points[point as usize].map(f64::from));
        let of = |&number: &u32| normals.get(number as usize).copied().unwrap_or_default().map(|x| x as f32);
        self.numbers().iter().map(of).collect()
    }
}
