//! Writes an archive of a mesh, or of the parts of one, below transforms, frame by frame.

mod ogawa;
mod parameter;
mod part;
mod tables;
mod tree;

use std::io::{self, Seek, Write};
use std::ops::Range;

use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::surface::{Part, Surface};

use super::ogawa::DATA;
use super::properties::{BOOL, F64, I8, Kind, U8};
use super::sampling::ACYCLIC;
use ogawa::Sink;
use part::PartWriter;
use tables::{Child, Compound, Metadata, Values, Written, write_object};
use tree::{Node, transforms};

/// Version 1.8.8 of the library whose files these are like.
const LIBRARY: i32 = 10808;
const TRANSFORM: &str = "schema=AbcGeom_Xform_v3";
const TRANSFORM_OBJECT: &str = "schema=AbcGeom_Xform_v3;schemaObjTitle=AbcGeom_Xform_v3:.xform";
/// A translation, among the operations of a transform.
const TRANSLATE: u8 = 0x10;
/// Index of the times of the frames; the first times of an archive are those of what has none.
const FRAMES: u32 = 1;

#[derive(Clone, Debug)]
pub(crate) struct Schedule {
    pub(crate) fps: f64,
    /// Numbers of frames, ascending, whose times are these over the frame rate; of evenly spaced
    /// ones the first alone.
    pub(crate) numbers: Vec<f64>,
    /// The distance of two that are.
    pub(crate) step: Option<f64>,
}

/// What is the same in all frames.
pub(crate) struct Scene<'a> {
    /// Name of the transform above what has no path.
    pub(crate) name: &'a str,
    pub(crate) points: usize,
    pub(crate) faces: &'a Polygons,
    /// What lies on these.
    pub(crate) surface: &'a Surface,
    pub(crate) schedule: Schedule,
    /// The translation above what lies far away, to keep it exact.
    pub(crate) origin: Option<Point>,
}

/// Meshes that are being written. Memory grows with the frames by a few bytes for each part.
pub(crate) struct MeshWriter<W> {
    sink: Sink<W>,
    schedule: Schedule,
    origin: Option<Point>,
    nodes: Vec<Node>,
    parts: Vec<PartWriter>,
    /// When each part is shown.
    shown: Vec<Option<Vec<Range<u32>>>>,
    frames: u32,
    bytes: Vec<u8>,
}

impl<W: Write + Seek> MeshWriter<W> {
    /// Begins an archive.
    pub(crate) fn new(out: W, scene: Scene<'_>) -> io::Result<Self> {
        let Scene { name, points, faces, surface, schedule, origin } = scene;
        let whole = Part { points, faces: faces.len(), ..Part::default() };
        let whole = Surface { parts: vec![whole], ..Surface::default() };
        let surface = if surface.is_empty() { &whole } else { surface };
        let mut sink = Sink::new(out)?;
        let parts = surface.ranges(faces).map(|part| PartWriter::new(&mut sink, part, faces, surface));
        let parts = parts.collect::<io::Result<_>>()?;
        let nodes = transforms(&surface.parts, name);
        let shown = surface.parts.iter().map(|part| part.shown.clone()).collect();
        Ok(Self { sink, schedule, origin, nodes, parts, shown, frames: 0, bytes: Vec::new() })
    }

    /// Writes a frame, `x y z x y z …`.
    pub(crate) fn write_frame(&mut self, positions: &[f32]) -> io::Result<()> {
        self.frames += 1;
        let points = positions.as_chunks().0;
        self.parts.iter_mut().try_for_each(|part| part.write_frame(&mut self.sink, points, &mut self.bytes))
    }

    /// Writes what says where the frames are; gives the file back.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        let mut metadata = Metadata::default();
        // What lies below each transform and, behind these, at the top; the last ones first.
        let mut below: Vec<Vec<Child>> = (0..=self.nodes.len()).map(|_| Vec::new()).collect();
        for (k, node) in std::mem::take(&mut self.nodes).into_iter().enumerate().rev() {
            let mut own = Compound::default();
            // What is hidden hides what lies below it.
            let is_alone = node.meshes.len() == 1 && !node.has_others;
            for (part, name) in node.meshes.into_iter().rev() {
                let mut properties = Compound::default();
                self.add_visibility(&mut metadata, if is_alone { &mut own } else { &mut properties }, part)?;
                below[k].push(self.parts[part].finish(&mut self.sink, &mut metadata, name, properties)?);
            }
            let transform = self.transform(&mut metadata, own, node.parent.is_none())?;
            below[k].reverse();
            let object = write_object(&mut self.sink, &mut metadata, &transform, &below[k])?;
            let above = node.parent.unwrap_or(below.len() - 1);
            below[above].push((node.name, TRANSFORM_OBJECT, object));
        }
        let sink = &mut self.sink;
        let none = Compound::default().write(sink)?;
        let mut tops = below.pop().unwrap_or_default();
        tops.reverse();
        let top = write_object(sink, &mut metadata, &none, &tops)?;

        let version = sink.data(&[&0_i32.to_le_bytes()])?;
        let library = sink.data(&[&LIBRARY.to_le_bytes()])?;
        let told =
            format!("_ai_AlembicVersion=Alembic 1.8.8;_ai_Application=cager;_ai_DCC_FPS={:?}", self.schedule.fps);
        let told = sink.data(&[told.as_bytes()])?;
        let times = sink.data(&[&self.schedule.table(self.frames)])?;
        let metadata = sink.data(&[&metadata.table()])?;
        let root = sink.group(&[version, library, top.group, told, times, metadata])?;
        self.sink.close(root)
    }

    /// Writes the properties of a transform behind its `own`: Maya shows no mesh without one above it.
    fn transform(&mut self, metadata: &mut Metadata, own: Compound, is_top: bool) -> io::Result<Written> {
        let sink = &mut self.sink;
        let still = |number, extent| Values { kind: Kind::Scalar, number, extent, sampling: 0 };
        let mut transform = Compound::default();
        if let Some(origin) = self.origin.filter(|_| is_top) {
            let sample = sink.sample(&[TRANSLATE])?;
            transform.add(sink, metadata, (".ops", ""), &[sample], &still(U8, 1))?;
            let sample = sink.sample(origin.map(f64::to_le_bytes).as_flattened())?;
            transform.add(sink, metadata, (".vals", ""), &[sample], &still(F64, 3))?;
        }
        let sample = sink.sample(&[1])?;
        transform.add(sink, metadata, (".inherits", ""), &[sample], &still(BOOL, 1))?;
        let transform = transform.write(sink)?;
        let mut properties = own;
        properties.add_compound(metadata, (".xform", TRANSFORM), &transform);
        properties.write(sink)
    }

    /// Adds whether a part is shown in each frame, where that changes.
    fn add_visibility(&mut self, metadata: &mut Metadata, properties: &mut Compound, part: usize) -> io::Result<()> {
        let Some(shown) = &self.shown[part] else { return Ok(()) };
        let samples = [self.sink.sample(&[0])?, self.sink.sample(&[1])?];
        let mut later = shown.iter().peekable();
        let in_frame = |frame: u32| {
            while later.next_if(|range| range.end <= frame).is_some() {}
            samples[usize::from(later.peek().is_some_and(|range| range.contains(&frame)))]
        };
        let stored: Vec<u64> = (0..self.frames).map(in_frame).collect();
        let values = Values { kind: Kind::Scalar, number: I8, extent: 1, sampling: FRAMES };
        properties.add(&mut self.sink, metadata, ("visible", ""), &stored, &values)
    }
}

impl Schedule {
    /// The times of what has none, and those of frames: samples, the cycle, and those stored.
    fn table(&self, frames: u32) -> Vec<u8> {
        let cycle = self.step.map_or(ACYCLIC, |step| step / self.fps);
        let stored = self.numbers.iter().map(|number| number / self.fps).collect();
        let mut table = Vec::new();
        for (samples, cycle, stored) in [(1, 1.0, vec![0.0]), (frames, cycle, stored)] {
            table.extend(u32::to_le_bytes(samples));
            table.extend(f64::to_le_bytes(cycle));
            table.extend((stored.len() as u32).to_le_bytes());
            table.extend(stored.iter().flat_map(|time| time.to_le_bytes()));
        }
        table
    }
}
