//! Frames as morph targets, their principal components, with the weights as an animation.

mod components;
mod deviation;
mod document;
mod normals;
mod stored;

use cager_geometry::mesh::Point;

use crate::error::Fault;
use components::{Components, Frames};
pub(crate) use components::{MOST_FRAMES, Wanted};
pub(crate) use deviation::Deviation;
pub(crate) use document::write_head;
use normals::normals;

/// What is written beside the frames.
pub(crate) struct Scene {
    /// The name of the node and its mesh.
    pub(crate) name: String,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Seconds of each frame; none where there is but one.
    pub(crate) times: Vec<f32>,
    /// The number of the first frame, and frames per second.
    pub(crate) numbering: [f64; 2],
    /// What is added to all positions.
    pub(crate) origin: Point,
    /// Whether positions are floats instead of whole numbers of 16 bits.
    pub(crate) floats: bool,
    pub(crate) normals: bool,
}

/// A mesh with its morph targets, ready to be written.
pub(crate) struct Morphs<'a> {
    scene: &'a Scene,
    components: Components,
    /// Those of the base and of all targets; none where none are wanted.
    normals: Vec<[f32; 3]>,
}

impl<'a> Morphs<'a> {
    /// Those of frames of so many points each, `x y z x y z …`, one after another.
    ///
    /// # Errors
    /// More than is wanted is lost; a file beyond 4 GiB.
    pub(crate) fn of(values: &[f32], points: usize, wanted: &Wanted, scene: &'a Scene) -> Result<Self, Fault> {
        let frames = Frames::new(values, points);
        // The node's place is rounded too.
        let rounding = |stored: &stored::Stored| document::place(stored, scene).map(|x| f64::from(x as f32) - x);
        let components = Components::of(&frames, scene.floats, wanted, rounding)?;
        let targets = components.deviation.targets;
        let normals = if scene.normals && !scene.triangles.is_empty() {
            normals(values, points, &scene.triangles, &components.weights, targets)
        } else {
            Vec::new()
        };
        let morphs = Self { scene, components, normals };
        morphs.check()?;
        Ok(morphs)
    }

    /// Targets, and how far what is written is from the frames.
    pub(crate) fn deviation(&self) -> &Deviation {
        &self.components.deviation
    }
}
