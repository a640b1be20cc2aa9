//! What lies on the faces of a model beside its points: named parts, texture coordinates, colours, hard edges, creases and materials.

mod normals;
mod parts;
mod pictures;
mod tilts;

pub use normals::{SharedNormals, Weights, numbered, sharing};
pub use parts::{Chosen, shown_in};
pub use pictures::{MOST_PICTURES, TILES, tile};
pub use tilts::Tilts;

use crate::mesh::Polygons;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Of a face without a material.
pub const NO_MATERIAL: u32 = u32::MAX;

/// The parts of a model and the materials that they share.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default)]
pub struct Surface {
    /// One after another: their points and faces are those of the model in order.
    pub parts: Vec<Part>,
    /// What [`Part::materials`] counts.
    pub materials: Vec<Material>,
    /// Those that textures name, as far as their bytes are known.
    #[serde(skip)]
    pub pictures: Vec<Picture>,
}

/// The file of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// As [`Texture::path`].
    pub path: String,
    /// As they are in the file.
    pub bytes: Arc<[u8]>,
}

/// One mesh of a scene.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default)]
pub struct Part {
    /// Names from the root of the scene down to the mesh with `/` between them; empty where there are none.
    pub path: String,
    /// How many points of the model are its own.
    pub points: usize,
    /// How many faces.
    pub faces: usize,
    /// Texture coordinates, `v` upwards.
    pub uv_sets: Vec<CornerSet<2>>,
    /// Linear colours, red, green, blue and alpha.
    pub color_sets: Vec<CornerSet<4>>,
    /// A number for each corner: where two faces meet, corners of a point that have the same number share a normal,
    /// and the edge is hard where they do not. Empty where the file has no normals.
    #[serde(skip)]
    pub normals: Vec<u32>,
    /// Where the normals of the file are others than those of the faces around, which ones these are; `None` where
    /// none is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tilts: Option<Tilts>,
    /// How much each of the faces around counts for a normal.
    #[serde(skip_serializing_if = "Weights::is_usual")]
    pub weights: Weights,
    /// How the mesh is to be subdivided.
    pub subdivision: Subdivision,
    /// Edges that a subdivision keeps sharp.
    pub creases: Vec<Crease>,
    /// The material of each face, [`NO_MATERIAL`] for none; empty where no face has one.
    #[serde(skip)]
    pub materials: Vec<u32>,
    /// Named sets of faces that are not materials.
    pub groups: Vec<FaceGroup>,
    /// Frames in which it is shown, counted from 0, ascending and apart; `None` where it always is.
    pub shown: Option<Vec<Range<u32>>>,
}

/// Values by corner, where corners share them.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub struct CornerSet<const N: usize> {
    /// What the file calls them.
    pub name: String,
    /// The values.
    #[serde(skip)]
    pub values: Vec<[f32; N]>,
    /// Which value each corner has, faces one after another.
    #[serde(skip)]
    pub corners: Vec<u32>,
}

/// A scheme of subdivision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Subdivision {
    /// Polygons as they are.
    #[default]
    None,
    /// Catmull and Clark 1978.
    CatmullClark,
    /// Loop 1987.
    Loop,
    /// Split without smoothing.
    Bilinear,
}

/// An edge that a subdivision keeps sharp.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct Crease {
    /// Points of the part, the smaller one first.
    pub edge: [u32; 2],
    /// 0 is smooth; 10 and more is sharp.
    pub sharpness: f32,
}

/// A named set of faces.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(default)]
pub struct FaceGroup {
    /// Its name.
    pub name: String,
    /// Faces of the part, ascending.
    #[serde(skip)]
    pub faces: Vec<u32>,
}

/// What a surface looks like: the part of it that MTL, UsdPreviewSurface, glTF and FBX have in common.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// Linear red, green and blue.
    pub base_color: [f32; 3],
    /// 1 is opaque.
    pub opacity: f32,
    /// 0 is a mirror.
    pub roughness: f32,
    /// 1 is metal.
    pub metalness: f32,
    /// Pictures in place of the numbers.
    pub textures: Vec<Texture>,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [0.8; 3],
            opacity: 1.0,
            roughness: 0.5,
            metalness: 0.0,
            textures: Vec::new(),
        }
    }
}

/// A picture that a material names.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct Texture {
    /// What it is for.
    pub channel: Channel,
    /// Its file as the source names it, with `/` between folders; of a sequence the first one.
    pub path: String,
    /// The file in each frame, where not all frames have the same; the last one stays.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<String>,
    /// The name of its texture coordinates; empty for the first of each part.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub uv_set: String,
    /// Which component of the picture counts, where it is not the usual one ([`Material::component`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub component: Option<Component>,
}

/// One of the numbers of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Component {
    /// The first, also of a picture that has no other.
    Red,
    /// The second.
    Green,
    /// The third.
    Blue,
    /// The fourth.
    Alpha,
}

impl Texture {
    /// One picture for all frames, with the first texture coordinates of each part and the usual component.
    pub fn new(channel: Channel, path: impl Into<String>) -> Self {
        Self { channel, path: path.into(), frames: Vec::new(), uv_set: String::new(), component: None }
    }

    /// Has these pictures, one in each frame; of none it stays as it is.
    pub fn set_frames(&mut self, frames: Vec<String>) {
        let Some(first) = frames.first() else { return };
        self.path.clone_from(first);
        let is_one = frames.iter().all(|path| path == first);
        self.frames = if is_one { Vec::new() } else { frames };
    }

    /// The picture of a frame, counted from 0.
    pub fn at(&self, frame: usize) -> &str {
        self.frames.get(frame).or(self.frames.last()).unwrap_or(&self.path)
    }
}

impl Material {
    /// Which component of a picture counts; `None` for red, green and blue as a colour or a direction.
    ///
    /// Where nothing is said, opacity is the alpha of the picture of the base colour, roughness and metalness of one
    /// picture are its green and blue, and everything else is red.
    pub fn component(&self, texture: &Texture) -> Option<Component> {
        let is_of = |channel| self.textures.iter().any(|other| other.channel == channel && other.path == texture.path);
        texture.component.or(match texture.channel {
            Channel::BaseColor | Channel::Normal | Channel::Emission => None,
            Channel::Opacity if is_of(Channel::BaseColor) => Some(Component::Alpha),
            Channel::Roughness if is_of(Channel::Metalness) => Some(Component::Green),
            Channel::Metalness if is_of(Channel::Roughness) => Some(Component::Blue),
            Channel::Opacity | Channel::Roughness | Channel::Metalness => Some(Component::Red),
        })
    }

    /// Leaves out which component counts where that is the usual one.
    pub fn forget_usual_components(&mut self) {
        for k in 0..self.textures.len() {
            let said = self.textures[k].component.take();
            if self.component(&self.textures[k]) != said {
                self.textures[k].component = said;
            }
        }
    }
}

/// What a picture says of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Base colour, in sRGB.
    BaseColor,
    /// Opacity.
    Opacity,
    /// Roughness.
    Roughness,
    /// Metalness.
    Metalness,
    /// Normals in tangent space.
    Normal,
    /// Light that it gives.
    Emission,
}

impl Channel {
    /// As files of this program name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::BaseColor => "base_color",
            Self::Opacity => "opacity",
            Self::Roughness => "roughness",
            Self::Metalness => "metalness",
            Self::Normal => "normal",
            Self::Emission => "emission",
        }
    }
}

impl Surface {
    /// Whether it says nothing that a model of points and faces does not.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// The parts with the first point, the first face and the corners of each among those of the model.
    pub fn ranges<'a>(&'a self, faces: &'a Polygons) -> impl Iterator<Item = (&'a Part, PartRange)> {
        let mut next = PartRange::default();
        self.parts.iter().map(move |part| {
            let first_face = next.faces.end;
            let faces_of = first_face..first_face + part.faces;
            let corners = faces.arities().get(faces_of.clone()).unwrap_or_default();
            let count = corners.iter().map(|&arity| arity as usize).sum::<usize>();
            next = PartRange {
                points: next.points.end..next.points.end + part.points,
                faces: faces_of,
                corners: next.corners.end..next.corners.end + count,
            };
            (part, next.clone())
        })
    }

    /// What is wrong with it as the surface of this many points and these faces, if anything is.
    ///
    /// # Errors
    /// A sentence that names the part.
    pub fn check(&self, points: usize, faces: &Polygons) -> Result<(), String> {
        let mut end = PartRange::default();
        for (part, range) in self.ranges(faces) {
            part.check(&range, faces, self.materials.len()).map_err(|what| format!("part {:?}: {what}", part.path))?;
            end = range;
        }
        if !self.is_empty() && (end.points.end, end.faces.end) != (points, faces.len()) {
            return Err(format!(
                "the parts have {} points and {} faces, the model has {points} and {}",
                end.points.end,
                end.faces.end,
                faces.len()
            ));
        }
        Ok(())
    }
}

/// Where a part lies in the lists of its model.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PartRange {
    /// Of its points.
    pub points: Range<usize>,
    /// Of its faces.
    pub faces: Range<usize>,
    /// Of the corners of its faces.
    pub corners: Range<usize>,
}

impl PartRange {
    /// The faces of the part, of its own points.
    pub fn local(&self, faces: &Polygons) -> Polygons {
        let mut local = Polygons::new();
        let first = self.points.start as u32;
        let mut corners = faces.indices().get(self.corners.clone()).unwrap_or_default();
        for &arity in faces.arities().get(self.faces.clone()).unwrap_or_default() {
            let Some(face) = corners.split_off(..arity as usize) else { break };
            local.push(&face.iter().map(|&point| point.wrapping_sub(first)).collect::<Vec<_>>());
        }
        local
    }
}

impl Part {
    /// Whether its normals say more than its faces do; `corners` are those of the faces.
    pub fn has_normals_of_its_own(&self, corners: &[u32]) -> bool {
        self.tilts.is_some() || self.has_hard_edges(corners)
    }

    /// Whether somewhere corners of one point have other normals; `corners` are those of its faces.
    pub fn has_hard_edges(&self, corners: &[u32]) -> bool {
        let mut first = HashMap::new();
        corners.iter().zip(&self.normals).any(|(point, normal)| first.entry(point).or_insert(normal) != &normal)
    }

    fn check(&self, range: &PartRange, faces: &Polygons, materials: usize) -> Result<(), String> {
        let (first, end) = (range.points.start as u32, range.points.end as u32);
        let corners = faces.indices().get(range.corners.clone()).ok_or("it has faces that the model lacks")?;
        if corners.iter().any(|&point| point < first || point >= end) {
            return Err("a face has a corner in another part".to_owned());
        }
        let count = corners.len();
        for set in &self.uv_sets {
            set.check(count).map_err(|what| format!("texture coordinates {:?}: {what}", set.name))?;
        }
        for set in &self.color_sets {
            set.check(count).map_err(|what| format!("colours {:?}: {what}", set.name))?;
        }
        let is_apart = |shown: &Vec<Range<u32>>| {
            shown.iter().all(|range| range.start < range.end)
                && shown.windows(2).all(|pair| pair[0].end <= pair[1].start)
        };
        if !self.shown.as_ref().is_none_or(is_apart) {
            return Err("the frames in which it is shown do not ascend".to_owned());
        }
        if !self.normals.is_empty() && self.normals.len() != count {
            return Err(format!("{} normals for {count} corners", self.normals.len()));
        }
        if let Some(tilts) = &self.tilts
            && (tilts.corners.len() != self.normals.len()
                || !tilts.corners.as_flattened().iter().all(|x| x.is_finite()))
        {
            return Err(format!("{} tilts of {} normals", tilts.corners.len(), self.normals.len()));
        }
        if !self.materials.is_empty() && self.materials.len() != self.faces {
            return Err(format!("materials for {} of {} faces", self.materials.len(), self.faces));
        }
        if self.materials.iter().any(|&k| k != NO_MATERIAL && k as usize >= materials) {
            return Err("a face has a material that is not there".to_owned());
        }
        if self.groups.iter().any(|group| group.faces.iter().any(|&face| face as usize >= self.faces)) {
            return Err("a group has a face that is not there".to_owned());
        }
        if self.creases.iter().any(|crease| crease.edge.iter().any(|&point| point as usize >= self.points)) {
            return Err("a crease has a point that is not there".to_owned());
        }
        Ok(())
    }
}

impl<const N: usize> CornerSet<N> {
    fn check(&self, corners: usize) -> Result<(), String> {
        if self.corners.len() != corners {
            return Err(format!("{} values for {corners} corners", self.corners.len()));
        }
        match self.corners.iter().find(|&&k| k as usize >= self.values.len()) {
            Some(k) => Err(format!("value {k} of {}", self.values.len())),
            None if self.values.iter().flatten().any(|x| !x.is_finite()) => Err("a value is not finite".to_owned()),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_lie_one_after_another_and_what_does_not_fit_is_said() {
        let mut faces = Polygons::new();
        faces.push(&[0, 1, 2]);
        faces.push(&[3, 4, 5, 6]);
        let part = |points, faces| Part { points, faces, ..Part::default() };
        let mut surface = Surface { parts: vec![part(3, 1), part(4, 1)], ..Surface::default() };
        surface.check(7, &faces).unwrap();
        let last = surface.ranges(&faces).last().unwrap().1;
        assert_eq!(last, PartRange { points: 3..7, faces: 1..2, corners: 3..7 });
        assert_eq!(last.local(&faces).indices(), [0, 1, 2, 3]);
        assert!(surface.check(8, &faces).unwrap_err().contains("7 points"));
        surface.parts[1].uv_sets.push(CornerSet {
            name: "UVMap".to_owned(),
            values: vec![[0.0; 2]],
            corners: vec![0, 0, 0, 1],
        });
        assert!(surface.check(7, &faces).unwrap_err().contains("value 1 of 1"));
        surface.parts[0].points = 4;
        assert!(surface.check(7, &faces).is_err());
    }
}
