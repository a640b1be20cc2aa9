//! Writes an archive of one polygon mesh below one transform, frame by frame.

mod ogawa;
mod tables;

use std::io::{self, Seek, Write};

use cager_geometry::mesh::{Point, Polygons};

use super::ogawa::DATA;
use super::properties::{BOOL, F32, F64, I32, Kind, U8};
use super::sampling::ACYCLIC;
use crate::scene::bounds;
use ogawa::Sink;
use tables::{Compound, Metadata, Values, write_object};

/// Version 1.8.8 of the library whose files these are like.
const LIBRARY: i32 = 10808;
const MESH: &str = "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1";
const MESH_OBJECT: &str =
    "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1;schemaObjTitle=AbcGeom_PolyMesh_v1:.geom";
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

/// A mesh that is being written. Memory does not grow with the frames but by 24 bytes for each.
pub(crate) struct MeshWriter<W> {
    sink: Sink<W>,
    schedule: Schedule,
    /// Name of the transform; that of the mesh has `Shape` behind it.
    name: String,
    origin: Option<Point>,
    /// Samples of what is the same in all frames: corners of all faces, and numbers of corners.
    faces: [u64; 2],
    positions: Vec<u64>,
    bounds: Vec<u64>,
    bytes: Vec<u8>,
}

impl<W: Write + Seek> MeshWriter<W> {
    /// Begins an archive; `origin` is the translation above what lies far away, to keep it exact.
    pub(crate) fn new(
        out: W,
        name: &str,
        faces: &Polygons,
        schedule: Schedule,
        origin: Option<Point>,
    ) -> io::Result<Self> {
        let mut sink = Sink::new(out)?;
        let corners: Vec<u8> = faces.iter().flat_map(|face| face.iter().rev()).flat_map(|k| k.to_le_bytes()).collect();
        let counts: Vec<u8> = faces.arities().iter().flat_map(|count| count.to_le_bytes()).collect();
        let faces = [sink.sample(&corners)?, sink.sample(&counts)?];
        let (positions, bounds, bytes) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { sink, schedule, name: name.to_owned(), origin, faces, positions, bounds, bytes })
    }

    /// Writes a frame, `x y z x y z …`.
    pub(crate) fn write_frame(&mut self, positions: &[f32]) -> io::Result<()> {
        self.bytes.clear();
        self.bytes.extend(positions.iter().flat_map(|x| x.to_le_bytes()));
        // Arrays have their sizes beside them, where these are not those of a list.
        self.positions.extend([self.sink.sample(&self.bytes)?, DATA]);
        let bounds: Vec<u8> =
            bounds(positions).as_flattened().iter().flat_map(|&x| f64::from(x).to_le_bytes()).collect();
        self.bounds.push(self.sink.sample(&bounds)?);
        Ok(())
    }

    /// Writes what says where the frames are; gives the file back.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        let frames = self.bounds.len() as u32;
        let (sink, mut metadata) = (&mut self.sink, Metadata::default());
        let moving = |kind, number, extent| Values { kind, number, extent, sampling: FRAMES };
        let still = |kind, number, extent| Values { kind, number, extent, sampling: 0 };

        let mut geometry = Compound::default();
        let bounds = (".selfBnds", "interpretation=box");
        geometry.add(sink, &mut metadata, bounds, &self.bounds, &moving(Kind::Scalar, F64, 6))?;
        let positions = ("P", "geoScope=vtx;interpretation=point");
        geometry.add(sink, &mut metadata, positions, &self.positions, &moving(Kind::Array, F32, 3))?;
        for (name, sample) in [".faceIndices", ".faceCounts"].into_iter().zip(self.faces) {
            geometry.add(sink, &mut metadata, (name, ""), &[sample, DATA], &still(Kind::Array, I32, 1))?;
        }
        let geometry = geometry.write(sink)?;
        let mut properties = Compound::default();
        properties.add_compound(&mut metadata, (".geom", MESH), &geometry);
        let properties = properties.write(sink)?;
        let mesh = write_object(sink, &mut metadata, &properties, None)?;

        // Maya shows no mesh without one above it.
        let mut transform = Compound::default();
        if let Some(origin) = self.origin {
            let sample = sink.sample(&[TRANSLATE])?;
            transform.add(sink, &mut metadata, (".ops", ""), &[sample], &still(Kind::Scalar, U8, 1))?;
            let sample = sink.sample(origin.map(f64::to_le_bytes).as_flattened())?;
            transform.add(sink, &mut metadata, (".vals", ""), &[sample], &still(Kind::Scalar, F64, 3))?;
        }
        let sample = sink.sample(&[1])?;
        transform.add(sink, &mut metadata, (".inherits", ""), &[sample], &still(Kind::Scalar, BOOL, 1))?;
        let transform = transform.write(sink)?;
        let mut properties = Compound::default();
        properties.add_compound(&mut metadata, (".xform", TRANSFORM), &transform);
        let properties = properties.write(sink)?;
        let shape = format!("{}Shape", self.name);
        let transform = write_object(sink, &mut metadata, &properties, Some(((&shape, MESH_OBJECT), &mesh)))?;
        let none = Compound::default().write(sink)?;
        let title = (self.name.as_str(), TRANSFORM_OBJECT);
        let top = write_object(sink, &mut metadata, &none, Some((title, &transform)))?;

        let version = sink.data(&[&0_i32.to_le_bytes()])?;
        let library = sink.data(&[&LIBRARY.to_le_bytes()])?;
        let told =
            format!("_ai_AlembicVersion=Alembic 1.8.8;_ai_Application=cager;_ai_DCC_FPS={:?}", self.schedule.fps);
        let told = sink.data(&[told.as_bytes()])?;
        let times = sink.data(&[&self.schedule.table(frames)])?;
        let metadata = sink.data(&[&metadata.table()])?;
        let root = sink.group(&[version, library, top.group, told, times, metadata])?;
        self.sink.close(root)
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
