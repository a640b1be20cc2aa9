//! Frames as morph targets, their principal components, with the weights as an animation.

mod components;
mod deviation;
mod document;
mod look;
mod nodes;
mod normals;
mod numbers;
mod pieces;
mod stored;

use cager_geometry::mesh::Point;
use cager_geometry::surface::Material;

use crate::error::Fault;
use components::{Components, Frames};
pub(crate) use components::{MOST_FRAMES, Wanted};
pub(crate) use deviation::Deviation;
pub(crate) use document::write_head;
pub(crate) use look::lost_pictures;
use normals::normals;
pub(crate) use pieces::Piece;

/// What is written beside the frames.
pub(crate) struct Scene {
    /// The name of the animation.
    pub(crate) name: String,
    /// The meshes.
    pub(crate) pieces: Vec<Piece>,
    pub(crate) materials: Vec<Material>,
    /// Seconds of each frame; none where there is but one.
    pub(crate) times: Vec<f32>,
    /// The number of the first frame, and frames per second.
    pub(crate) numbering: [f64; 2],
    /// What is added to all positions.
    pub(crate) origin: Point,
    /// Whether positions are floats instead of whole numbers of 16 bits.
    pub(crate) floats: bool,
}

/// A mesh with its morph targets, ready to be written.
pub(crate) struct Morphs<'a> {
    scene: &'a Scene,
    components: Components,
    /// Those of the base and of all targets, of each those of all meshes that have some.
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
        let rounding = |stored: &stored::Stored| numbers::place(stored, scene).map(|x| f64::from(x as f32) - x);
        let components = Components::of(&frames, scene.floats, wanted, rounding)?;
        let targets = components.deviation.targets;
        let with_normals = || scene.pieces.iter().filter_map(|piece| piece.normals.as_ref());
        let of_frame = |positions: &[f32]| with_normals().flat_map(|normals| normals.at(positions)).collect();
        let count = with_normals().map(|normals| normals.count(points)).sum();
        let frames = values.chunks_exact(3 * points);
        let normals =
            if count > 0 { normals(frames, count, of_frame, &components.weights, targets) } else { Vec::new() };
        let morphs = Self { scene, components, normals };
        morphs.check()?;
        Ok(morphs)
    }

    /// Targets, and how far what is written is from the frames.
    pub(crate) fn deviation(&self) -> &Deviation {
        &self.components.deviation
    }
}
