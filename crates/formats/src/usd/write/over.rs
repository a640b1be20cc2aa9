//! Writes a layer on top of another one: the points of its meshes in each frame, and nothing else.

use std::collections::BTreeMap;
use std::io::{self, Seek, Write};

use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::surface::Surface;
use cager_geometry::units::{Units, Up};

use super::encoder::Encoder;
use super::mesh::Mesh;
use super::property::Property;
use super::sink::Sink;
use super::{ORDER, TRANSLATE};
use crate::usd::binary::ROOT;
use crate::usd::onto::Onto;

/// Meshes of another layer whose points are being written.
pub(crate) struct OverWriter<W> {
    encoder: Encoder<W>,
    onto: Onto,
    meshes: Vec<Mesh>,
    fps: f64,
    codes: Vec<f64>,
    units: Units,
    origin: Option<Point>,
}

/// Names below a name, and which mesh is there.
#[derive(Default)]
struct Node {
    children: BTreeMap<String, Node>,
    mesh: Option<usize>,
}

impl<W: Write + Seek> OverWriter<W> {
    /// Begins a layer of frames at these time codes.
    pub(crate) fn new(
        out: W,
        faces: &Polygons,
        surface: &Surface,
        onto: Onto,
        (fps, codes): (f64, Vec<f64>),
        origin: Option<Point>,
    ) -> io::Result<Self> {
        let mut encoder = Encoder::new(Sink::new(out, None)?);
        let mut meshes = Vec::new();
        for ((part, range), moved) in surface.ranges(faces).zip(&onto.meshes) {
            // Normals of corners are in the order of the faces that they are of.
            let has_normals = moved.has_all_faces && !moved.is_turned;
            meshes.push(Mesh::moved(&mut encoder, part, &range, &range.local(faces), has_normals)?);
        }
        let units = onto.units;
        Ok(Self { encoder, onto, meshes, fps, codes, units, origin })
    }

    pub(crate) fn write_frame(&mut self, positions: &[f32]) -> io::Result<()> {
        let points = positions.as_chunks().0;
        self.meshes.iter_mut().try_for_each(|mesh| mesh.write_frame(&mut self.encoder, points))
    }

    /// Writes what says where the frames are; gives the file back.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        let times = self.encoder.times(&self.codes)?;
        let mut root = Node::default();
        for (mesh, moved) in self.onto.meshes.iter().enumerate() {
            let names = moved.path.split('/').filter(|name| !name.is_empty());
            let node = names.fold(&mut root, |node, name| node.children.entry(name.to_owned()).or_default());
            node.mesh = Some(mesh);
        }
        let encoder = &mut self.encoder;
        let names: Vec<&str> = root.children.keys().map(String::as_str).collect();
        let mut fields = encoder.timing(self.fps, &self.codes)?.to_vec();
        fields.extend([
            ("subLayers", encoder.strings(&[&self.onto.file])?),
            ("subLayerOffsets", encoder.layer_offset()?),
            ("primChildren", encoder.tokens(&names)?),
        ]);
        if let Some(metres) = self.units.metres_per_unit {
            fields.push(("metersPerUnit", encoder.double(metres)?));
        }
        if let Some(up) = self.units.up {
            fields.push(("upAxis", encoder.token(if up == Up::Z { "Z" } else { "Y" })));
        }
        encoder.tables.begin(ROOT, "", &fields);
        for (name, node) in &root.children {
            self.put(name, node, times)?;
        }
        self.encoder.tables.end();
        self.encoder.close(&[])
    }

    fn put(&mut self, name: &str, node: &Node, times: u64) -> io::Result<()> {
        let mut properties = Vec::new();
        if let Some(mesh) = node.mesh {
            properties = self.meshes[mesh].moved_properties(&mut self.encoder, times)?;
            let has = |properties: &[Property], name: &str| properties.iter().any(|property| property.is_called(name));
            for (name, type_name) in &self.onto.meshes[mesh].blocked {
                if !has(&properties, name) {
                    properties.push(Property::new(type_name.clone(), name.as_str()).value(Encoder::<W>::BLOCK));
                }
            }
            // What mirrored the mesh moves it no more.
            let orientation = if self.onto.meshes[mesh].is_turned { "leftHanded" } else { "rightHanded" };
            properties.push(Property::fixed("orientation", orientation));
            // Points are where they are in the scene, whatever is above them.
            let mut order = vec!["!resetXformStack!"];
            if let Some(origin) = self.origin {
                order.push(TRANSLATE);
                let at = self.encoder.vector(origin)?;
                properties.push(Property::new("double3", TRANSLATE).value(at));
            }
            let order = self.encoder.token_array(&order)?;
            properties.push(Property::new("token[]", ORDER).uniform().value(order));
        }
        let children: Vec<&str> = node.children.keys().map(String::as_str).collect();
        self.encoder.over(name, &properties, &children)?;
        for (name, child) in &node.children {
            self.put(name, child, times)?;
        }
        self.encoder.tables.end();
        Ok(())
    }
}
