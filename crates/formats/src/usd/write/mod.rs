//! Writes a layer of polygon meshes and their cage, if any, below one transform, frame by frame, in
//! version 0.8.0 of the binary format, which USD reads since 2019.

mod encoder;
mod faces;
mod material;
mod mesh;
mod over;
mod property;
mod sink;
mod tables;
mod tree;

use std::io::{self, Seek, Write};
use std::sync::Arc;

use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::surface::{PartRange, Surface};
use cager_geometry::units::{Units, Up};

use super::binary::ROOT;
use crate::pictures::rename;
use encoder::Encoder;
use mesh::Mesh;
pub(crate) use over::OverWriter;
use property::{Prim, Property};
use sink::Sink;
use tree::Tree;

/// What a file is to hold beside positions and faces.
pub(crate) struct Scene {
    /// Name of the transform, below which the mesh is called `mesh`, where the parts have no others.
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
    /// What lies on the faces, and fits them.
    pub(crate) surface: Surface,
}

/// Meshes that are being written. Memory does not grow with the frames but by some bytes for each
/// mesh.
pub(crate) struct MeshWriter<W> {
    encoder: Encoder<W>,
    scene: Scene,
    tree: Tree,
    /// Those of the parts, then the cage where there is one.
    meshes: Vec<Mesh>,
    materials: Option<Prim>,
    cage: Option<usize>,
    /// The other files of a package.
    pictures: Vec<(String, Arc<[u8]>)>,
}

impl<W: Write + Seek> MeshWriter<W> {
    /// Begins a layer of a mesh of these faces, and of a cage where its faces are given.
    pub(crate) fn new(
        out: W,
        (points, faces): (usize, &Polygons),
        cage: Option<(usize, &Polygons)>,
        mut scene: Scene,
    ) -> io::Result<Self> {
        let sink = Sink::new(out, scene.is_packed.then(|| format!("{}.usdc", scene.name)))?;
        let mut encoder = Encoder::new(sink);
        let mut pictures = Vec::new();
        if scene.is_packed {
            let files = rename(&mut scene.surface, PICTURES).into_iter();
            pictures.extend(files.map(|(name, bytes)| (format!("{PICTURES}/{name}"), bytes)));
        }
        let surface = &scene.surface;
        let paths = surface.parts.iter().map(|part| part.path.as_str());
        // Of a model without parts, one without a name.
        let mut tree = Tree::new(paths.chain(surface.is_empty().then_some("")), &scene.name);
        let (mut meshes, mut materials, mut bindings) = (Vec::new(), None, Vec::new());
        if !surface.materials.is_empty() {
            let root = format!("/{}", tree.nodes[0].name);
            let (group, paths) = material::materials(&mut encoder, surface, &root, &scene.codes)?;
            (materials, bindings) = (Some(group), paths);
        }
        for (part, range) in surface.ranges(faces) {
            meshes.push(Mesh::of_part(&mut encoder, part, &range, &range.local(faces), &bindings)?);
        }
        let whole = |points| PartRange { points: 0..points, ..PartRange::default() };
        if surface.is_empty() {
            meshes.push(Mesh::new(&mut encoder, &whole(points), faces)?);
        }
        let cage = match cage {
            Some((points, faces)) => {
                tree.add_helper("cage", meshes.len());
                let mut mesh = Mesh::new(&mut encoder, &whole(points), faces)?;
                mesh.is_guide = true;
                meshes.push(mesh);
                Some(meshes.len() - 1)
            }
            None => None,
        };
        Ok(Self { encoder, scene, tree, meshes, materials, cage, pictures })
    }

    /// Bytes of the file, about, with so many frames.
    pub(crate) fn size(&self, frames: usize) -> usize {
        let pictures: usize = self.pictures.iter().map(|(name, bytes)| bytes.len() + name.len() + 256).sum();
        let of_frame: usize = self.meshes.iter().map(Mesh::frame_size).sum();
        frames.saturating_mul(of_frame).saturating_add(pictures)
    }

    /// Writes a frame, `x y z x y z …`, of the model, or of the cage where one was announced.
    pub(crate) fn write_frame(&mut self, positions: &[f32], is_cage: bool) -> io::Result<()> {
        let end = self.cage.unwrap_or(self.meshes.len());
        let range = if is_cage { end..self.meshes.len() } else { 0..end };
        let points = positions.as_chunks().0;
        self.meshes[range].iter_mut().try_for_each(|mesh| mesh.write_frame(&mut self.encoder, points))
    }

    /// Writes what says where the frames are; gives the file back.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        let times = self.encoder.times(&self.scene.codes)?;
        let (encoder, scene, root) = (&mut self.encoder, &self.scene, &self.tree.nodes[0].name);
        let up = if scene.units.up == Some(Up::Z) { "Z" } else { "Y" };
        let mut fields = encoder.timing(scene.fps, &scene.codes)?.to_vec();
        fields.extend([
            ("defaultPrim", encoder.token(root)),
            ("metersPerUnit", encoder.double(scene.units.metres_per_unit.unwrap_or(1.0))?),
            ("upAxis", encoder.token(up)),
            ("primChildren", encoder.tokens(&[root])?),
        ]);
        encoder.tables.begin(ROOT, "", &fields);
        self.put(0, times)?;
        self.encoder.tables.end();
        self.encoder.close(&self.pictures)
    }

    /// Writes a node of the tree and what lies below it.
    fn put(&mut self, node: usize, times: u64) -> io::Result<()> {
        let tree::Node { name, children, mesh, .. } = &mut self.tree.nodes[node];
        let (name, children) = (std::mem::take(name), std::mem::take(children));
        if let Some(mesh) = *mesh {
            let prim = self.meshes[mesh].prim(&mut self.encoder, name, times, &self.scene.codes)?;
            return self.encoder.prim(&prim);
        }
        let materials = self.materials.take_if(|_| node == 0);
        let mut names: Vec<&str> = children.iter().map(|&child| self.tree.nodes[child].name.as_str()).collect();
        names.extend(materials.as_ref().map(|group| group.name.as_str()));
        self.encoder.token("Xform");
        let origin = self.scene.origin.filter(|_| node == 0);
        let properties = if origin.is_some() { vec![TRANSLATE, ORDER] } else { Vec::new() };
        self.encoder.begin(&name, ("Xform", false), &properties, &names)?;
        if let Some(origin) = origin {
            let at = self.encoder.vector(origin)?;
            self.encoder.property(&Property::new("double3", TRANSLATE).value(at));
            let order = self.encoder.token_array(&[TRANSLATE])?;
            self.encoder.property(&Property::new("token[]", ORDER).uniform().value(order));
        }
        children.into_iter().try_for_each(|child| self.put(child, times))?;
        if let Some(materials) = materials {
            self.encoder.prim(&materials)?;
        }
        self.encoder.tables.end();
        Ok(())
    }
}

/// Folder of pictures in a package.
const PICTURES: &str = "textures";
const TRANSLATE: &str = "xformOp:translate";
const ORDER: &str = "xformOpOrder";
