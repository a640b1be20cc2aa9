//! Writes a layer of one polygon mesh and its cage, if any, below one transform, frame by frame, in
//! version 0.8.0 of the binary format, which USD reads since 2019.

mod sink;
mod tables;

use std::io::{self, Seek, Write};

use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::units::{Units, Up};

use super::binary::{ATTRIBUTE, CHILD_ONLY, LAST, MAGIC, PRIM, ROOT, SIBLING, kind};
use crate::scene::bounds;
use sink::Sink;
use tables::{Tables, integers};

const VERSION: [u8; 3] = [0, 8, 0];
/// Bits of a value: an array, one that is in place of its offset, one that is packed.
const ARRAY: u64 = 1 << 63;
const INLINED: u64 = 1 << 62;
const PACKED: u64 = 1 << 61;
/// Shorter arrays of whole numbers are not packed, nor longer ones, which LZ4 has in pieces.
const PACKED_FROM: usize = 16;
const PACKED_TO: usize = 1 << 28;

/// What a file is to hold beside positions and faces.
pub(crate) struct Scene {
    /// Name of the transform, below which the mesh is called `mesh`.
    pub(crate) name: String,
    pub(crate) fps: f64,
    /// Time codes of all frames, ascending.
    pub(crate) codes: Vec<f64>,
    /// Metres and Y up where nothing is said.
    pub(crate) units: Units,
    /// The translation above the mesh, which keeps exact what lies far away.
    pub(crate) origin: Option<Point>,
    /// Whether the layer is put into a package.
    pub(crate) is_packed: bool,
}

/// A mesh that is being written. Memory does not grow with the frames but by 24 bytes for each.
pub(crate) struct MeshWriter<W> {
    sink: Sink<W>,
    scene: Scene,
    /// The mesh, and its cage where there is one.
    meshes: Vec<Mesh>,
    bytes: Vec<u8>,
}

/// Values of what is written of a mesh.
struct Mesh {
    name: &'static str,
    /// How many corners faces have, and which.
    faces: [u64; 2],
    points: Vec<u64>,
    extents: Vec<u64>,
}

impl<W: Write + Seek> MeshWriter<W> {
    /// Begins a layer of a mesh of these faces, and of a cage where its faces are given.
    pub(crate) fn new(out: W, faces: &Polygons, cage: Option<&Polygons>, scene: Scene) -> io::Result<Self> {
        let sink = Sink::new(out, scene.is_packed.then(|| format!("{}.usdc", scene.name)))?;
        let mut writer = Self { sink, scene, meshes: Vec::new(), bytes: Vec::new() };
        for (name, faces) in [("mesh", Some(faces)), (CAGE, cage)] {
            let Some(faces) = faces else { continue };
            let counts: Vec<i32> = faces.arities().iter().map(|&count| count as i32).collect();
            let corners: Vec<i32> = faces.indices().iter().map(|&corner| corner as i32).collect();
            let faces = [writer.integers(&counts)?, writer.integers(&corners)?];
            writer.meshes.push(Mesh { name, faces, points: Vec::new(), extents: Vec::new() });
        }
        Ok(writer)
    }

    /// Writes a frame, `x y z x y z …`, of the mesh, or of the cage where one was announced.
    pub(crate) fn write_frame(&mut self, positions: &[f32], is_cage: bool) -> io::Result<()> {
        let points = self.vectors(positions)?;
        let extent = self.vectors(bounds(positions).as_flattened())?;
        if let Some(mesh) = self.meshes.get_mut(usize::from(is_cage)) {
            mesh.points.push(points);
            mesh.extents.push(extent);
        }
        Ok(())
    }

    /// Writes what says where the frames are; gives the file back.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        let codes: Vec<u8> = self.scene.codes.iter().flat_map(|code| code.to_le_bytes()).collect();
        let times = self.list(kind::DOUBLES, self.scene.codes.len(), &codes)?;

        let mut tables = Tables::default();
        // A first name that no property has, as its negative would be no other number.
        tables.token(";-)");
        let (name, fps) = (self.scene.name.clone(), self.double(self.scene.fps)?);
        let (start, end) = (self.scene.codes.first().copied(), self.scene.codes.last().copied());
        let up = if self.scene.units.up == Some(Up::Z) { "Z" } else { "Y" };
        let root = [
            ("defaultPrim", token(&mut tables, &name)),
            ("endTimeCode", self.double(end.unwrap_or(0.0))?),
            ("framesPerSecond", fps),
            ("metersPerUnit", self.double(self.scene.units.metres_per_unit.unwrap_or(1.0))?),
            ("startTimeCode", self.double(start.unwrap_or(0.0))?),
            ("timeCodesPerSecond", fps),
            ("upAxis", token(&mut tables, up)),
            ("primChildren", self.tokens(&mut tables, &[&name])?),
        ];
        tables.spec(ROOT, "", CHILD_ONLY, &root);

        let defined = ("specifier", INLINED | value(kind::SPECIFIER, 0));
        let uniform = ("variability", INLINED | value(kind::VARIABILITY, 1));
        let mut transform = vec![defined, ("typeName", token(&mut tables, "Xform"))];
        if self.scene.origin.is_some() {
            transform.push(("properties", self.tokens(&mut tables, &[TRANSLATE, ORDER])?));
        }
        let meshes = std::mem::take(&mut self.meshes);
        let names: Vec<&str> = meshes.iter().map(|mesh| mesh.name).collect();
        transform.push(("primChildren", self.tokens(&mut tables, &names)?));
        tables.spec(PRIM, &name, CHILD_ONLY, &transform);
        if let Some(origin) = self.scene.origin {
            self.sink.align()?;
            let at = self.sink.put(origin.map(f64::to_le_bytes).as_flattened())?;
            let fields = [("typeName", token(&mut tables, "double3")), ("default", value(kind::VEC3D, at))];
            tables.spec(ATTRIBUTE, TRANSLATE, SIBLING, &fields);
            let order = ARRAY | self.list(kind::TOKEN, 1, &tables.token(TRANSLATE).to_le_bytes())?;
            let fields = [("typeName", token(&mut tables, "token[]")), uniform, ("default", order)];
            tables.spec(ATTRIBUTE, ORDER, SIBLING, &fields);
        }

        for (k, mesh) in meshes.iter().enumerate() {
            let is_last = k + 1 == meshes.len();
            let jump = if is_last { CHILD_ONLY } else { 1 + PROPERTIES.len() as i32 };
            self.put_mesh(&mut tables, jump, mesh, times)?;
        }

        let contents = tables.write(&mut self.sink)?;
        let head = [&MAGIC[..], &VERSION, &[0; 5], &contents.to_le_bytes()].concat();
        self.sink.close(&head)
    }

    /// A mesh and its properties; the cage is a guide, which programs show and do not render.
    fn put_mesh(&mut self, tables: &mut Tables, jump: i32, mesh: &Mesh, times: u64) -> io::Result<()> {
        let [points_at, extents_at] = [self.samples(times, &mesh.points)?, self.samples(times, &mesh.extents)?];
        let first = mesh.points.first().copied().unwrap_or(ARRAY | value(kind::VEC3F, 0));
        let uniform = ("variability", INLINED | value(kind::VARIABILITY, 1));
        let is_guide = mesh.name == CAGE;
        let mut names = PROPERTIES.to_vec();
        names.extend(is_guide.then_some(PURPOSE));
        let properties = ("properties", self.tokens(tables, &names)?);
        let prim =
            [("specifier", INLINED | value(kind::SPECIFIER, 0)), ("typeName", token(tables, "Mesh")), properties];
        tables.spec(PRIM, mesh.name, jump, &prim);
        let kinds = ["float3[]", "int[]", "point3f[]", "token"];
        let [extent, integers, point, text] = kinds.map(|kind| ("typeName", token(tables, kind)));
        let [counts, corners] = mesh.faces;
        tables.spec(ATTRIBUTE, names[0], SIBLING, &[extent, ("timeSamples", extents_at)]);
        tables.spec(ATTRIBUTE, names[1], SIBLING, &[integers, ("default", counts)]);
        tables.spec(ATTRIBUTE, names[2], SIBLING, &[integers, ("default", corners)]);
        // Readers without a time take the first frame.
        tables.spec(ATTRIBUTE, names[3], SIBLING, &[point, ("default", first), ("timeSamples", points_at)]);
        // Otherwise programs subdivide it.
        let plain = ("default", token(tables, "none"));
        let last = if is_guide { SIBLING } else { LAST };
        tables.spec(ATTRIBUTE, names[4], last, &[text, uniform, plain]);
        if is_guide {
            let guide = ("default", token(tables, "guide"));
            tables.spec(ATTRIBUTE, PURPOSE, LAST, &[text, uniform, guide]);
        }
        Ok(())
    }

    /// Some elements behind how many they are.
    fn list(&mut self, kind: u8, count: usize, bytes: &[u8]) -> io::Result<u64> {
        self.sink.align()?;
        let at = self.sink.put(&(count as u64).to_le_bytes())?;
        self.sink.put(bytes)?;
        Ok(value(kind, at))
    }

    fn vectors(&mut self, numbers: &[f32]) -> io::Result<u64> {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        let array = self.list(kind::VEC3F, numbers.len() / 3, &bytes);
        self.bytes = bytes;
        Ok(ARRAY | array?)
    }

    fn integers(&mut self, numbers: &[i32]) -> io::Result<u64> {
        if !(PACKED_FROM..=PACKED_TO).contains(&numbers.len()) {
            let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
            return Ok(ARRAY | self.list(kind::INT, numbers.len(), &bytes)?);
        }
        let bytes = integers(numbers);
        let sized = [&(bytes.len() as u64).to_le_bytes()[..], &bytes].concat();
        Ok(ARRAY | PACKED | self.list(kind::INT, numbers.len(), &sized)?)
    }

    fn tokens(&mut self, tables: &mut Tables, names: &[&str]) -> io::Result<u64> {
        let bytes: Vec<u8> = names.iter().flat_map(|name| tables.token(name).to_le_bytes()).collect();
        self.list(kind::TOKENS, names.len(), &bytes)
    }

    fn double(&mut self, number: f64) -> io::Result<u64> {
        if f64::from(number as f32) == number {
            return Ok(INLINED | value(kind::DOUBLE, (number as f32).to_bits().into()));
        }
        self.sink.align()?;
        Ok(value(kind::DOUBLE, self.sink.put(&number.to_le_bytes())?))
    }

    /// Values at times: where the value of these is, counted from there, and where the others are.
    fn samples(&mut self, times: u64, values: &[u64]) -> io::Result<u64> {
        self.sink.align()?;
        let at = self.sink.put(&8_u64.to_le_bytes())?;
        let head = [times, 8, values.len() as u64];
        let bytes: Vec<u8> = head.iter().chain(values).flat_map(|number| number.to_le_bytes()).collect();
        self.sink.put(&bytes)?;
        Ok(value(kind::TIME_SAMPLES, at))
    }
}

const CAGE: &str = "cage";
/// Of meshes; cages have a purpose as well.
const PROPERTIES: [&str; 5] = ["extent", "faceVertexCounts", "faceVertexIndices", "points", "subdivisionScheme"];
const PURPOSE: &str = "purpose";

const TRANSLATE: &str = "xformOp:translate";
const ORDER: &str = "xformOpOrder";

fn token(tables: &mut Tables, text: &str) -> u64 {
    INLINED | value(kind::TOKEN, tables.token(text).into())
}

fn value(kind: u8, payload: u64) -> u64 {
    u64::from(kind) << 48 | payload
}
