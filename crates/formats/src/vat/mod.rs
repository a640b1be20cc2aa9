//! Vertex animation textures as OpenVAT has them: a mesh, an image of what each frame moves its
//! points by, one of normals, and the bounds of both as JSON, for game engines without caches.
//!
//! The axes in the images are those of Blender, whose up is z: red is x, green −z and blue y.

mod layout;
mod mesh;
mod png;

use std::io::{self, Write};

use cager_geometry::mesh::Point;

use crate::error::Fault;
use crate::normals::vertex_normals;
use layout::Layout;
use png::Png;

/// The largest number of a channel.
const LARGEST: f64 = 65535.0;

/// What is written beside the frames.
pub(crate) struct Scene {
    /// The name of the mesh, with which those of all files begin.
    pub(crate) name: String,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) fps: f64,
    /// What is added to all positions.
    pub(crate) origin: Point,
}

pub(crate) struct Textures<'a> {
    scene: &'a Scene,
    /// Coordinates of all points, frame after frame.
    frames: &'a [f32],
    layout: Layout,
    /// By how much points move, in the axes of the images.
    low: [f64; 3],
    high: [f64; 3],
}

pub(crate) fn check(points: usize, frames: usize) -> Result<(), Fault> {
    Layout::of(points, frames).map(|_| ())
}

/// In the axes of the images.
fn turned([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, -z, y]
}

impl<'a> Textures<'a> {
    /// Those of frames of so many points each, of which the first one is the mesh.
    pub(crate) fn of(frames: &'a [f32], points: usize, scene: &'a Scene) -> Result<Self, Fault> {
        let layout = Layout::of(points, frames.len() / (3 * points))?;
        let mut textures = Self { scene, frames, layout, low: [0.0; 3], high: [0.0; 3] };
        let (mut low, mut high) = ([0.0_f64; 3], [0.0_f64; 3]);
        for frame in 0..layout.frames {
            for point in 0..points {
                let by = textures.moved(frame, point);
                low = std::array::from_fn(|k| low[k].min(by[k]));
                high = std::array::from_fn(|k| high[k].max(by[k]));
            }
        }
        (textures.low, textures.high) = (low, high);
        Ok(textures)
    }

    /// The largest distance that rounding puts between a point and where it belongs.
    pub(crate) fn rounding(&self) -> f64 {
        let half = (0..3).map(|k| 0.5 * (self.high[k] - self.low[k]) / LARGEST);
        half.map(|x| x * x).sum::<f64>().sqrt()
    }

    /// Writes the file of each name, to what `create` gives for it.
    pub(crate) fn write<W: Write>(&self, mut create: impl FnMut(&str) -> io::Result<W>) -> io::Result<()> {
        let (name, points) = (&self.scene.name, self.layout.points);
        let mut out = create(&format!("{name}.glb"))?;
        mesh::write(&mut out, &self.frames[..3 * points], &self.layout, self.scene)?;
        out.flush()?;
        let mut out = create(&format!("{name}-remap_info.json"))?;
        out.write_all(self.remap_info().as_bytes())?;
        out.flush()?;

        let (width, height) = (self.layout.width as u32, self.layout.height() as u32);
        let mut image = Png::new(create(&format!("{name}_vat.png"))?, width, height)?;
        for (points, frame) in self.layout.rows() {
            image.row(points.map(|point| {
                let by = self.moved(frame, point);
                std::array::from_fn(|k| {
                    let range = self.high[k] - self.low[k];
                    if range > 0.0 { ((by[k] - self.low[k]) / range * LARGEST).round() as u16 } else { 0 }
                })
            }))?;
        }
        image.finish()?;
        let mut image = Png::new(create(&format!("{name}_vnrm.png"))?, width, height)?;
        let mut normals = Vec::new();
        for (range, frame) in self.layout.rows() {
            vertex_normals(
                &self.frames[3 * frame * points..3 * (frame + 1) * points],
                &self.scene.triangles,
                &mut normals,
            );
            let channel = |x: f64| ((0.5 + 0.5 * x) * LARGEST).round() as u16;
            image.row(normals[range].iter().map(|normal| turned(normal.map(f64::from)).map(channel)))?;
        }
        image.finish()
    }

    /// By how much a point is beside its place in the mesh.
    fn moved(&self, frame: usize, point: usize) -> [f64; 3] {
        let at = |frame: usize, k: usize| f64::from(self.frames[3 * (frame * self.layout.points + point) + k]);
        turned(std::array::from_fn(|k| at(frame, k) - at(0, k)))
    }

    fn remap_info(&self) -> String {
        let Scene { name, fps, .. } = self.scene;
        let (low, high, frames) = (self.low, self.high, self.layout.frames);
        format!(
            "{{\n    \"os-remap\": {{\"Min\": {low:?}, \"Max\": {high:?}, \"Frames\": {frames}}},\n    \"animations\": \
             {{\"{name}\": {{\"startFrame\": 0, \"endFrame\": {}, \"framerate\": {fps}, \"looping\": true}}}}\n}}\n",
            frames - 1
        )
    }
}
