//! Texture coordinates of vertices or of the corners of faces, and the pictures that comments name.

use cager_geometry::mesh::Model;
use cager_geometry::surface::{Channel, CornerSet, Material, NO_MATERIAL, Part, Surface, Texture};

use crate::scene::merged;

/// Names of a texture coordinate of vertices, in the order of `s` and `t`.
const NAMES: [[&str; 4]; 2] = [["s", "u", "texture_u", "texture_s"], ["t", "v", "texture_v", "texture_t"]];

/// The plain name of a property of vertices.
pub(super) fn plain(name: &str) -> &str {
    NAMES.iter().find(|names| names.contains(&name)).map_or(name, |names| names[0])
}

/// What a file says so far.
#[derive(Default)]
pub(super) struct Coordinates {
    /// Of each vertex.
    pub(super) vertices: Vec<[f32; 2]>,
    /// Of the corners of the faces that are kept; empty where a face lacks them.
    corners: Vec<[f32; 2]>,
    lacks_some: bool,
    /// Which picture each face has.
    numbers: Vec<u32>,
}

impl Coordinates {
    /// Takes those of a face of so many corners, and the number of its picture.
    pub(super) fn face(&mut self, corners: usize, values: &[f64], picture: f64) {
        self.numbers.push(if picture < 0.0 { NO_MATERIAL } else { picture as u32 });
        self.lacks_some |= values.len() != 2 * corners;
        if !self.lacks_some {
            self.corners.extend(values.as_chunks().0.iter().map(|uv: &[f64; 2]| uv.map(|x| x as f32)));
        }
    }

    /// Puts them on the faces of a model with these pictures; gives whether there are any.
    pub(super) fn finish(self, model: &mut Model, pictures: &[String]) -> bool {
        let corners = model.faces.indices();
        let mut set = CornerSet::default();
        if !self.lacks_some && self.corners.len() == corners.len() {
            set = merged(String::new(), &self.corners, (0..corners.len() as u32).collect());
        } else if self.vertices.len() == model.points.len() {
            (set.values, set.corners) = (self.vertices, corners.to_vec());
        }
        if set.corners.is_empty() || set.values.iter().flatten().any(|x| !x.is_finite()) {
            return false;
        }
        let faces = model.faces.len();
        let material = |path: &String| Material {
            name: path.rsplit(['/', '\\']).next().unwrap_or(path).to_owned(),
            textures: vec![Texture::new(Channel::BaseColor, path.replace('\\', "/"))],
            ..Material::default()
        };
        let materials: Vec<Material> = pictures.iter().map(material).collect();
        let most = (materials.len() as u32).saturating_sub(1);
        let numbers = if self.numbers.len() == faces { self.numbers } else { vec![0; faces] };
        let of_faces =
            numbers.iter().map(|&number| if number == NO_MATERIAL { number } else { number.min(most) }).collect();
        let part = Part {
            points: model.points.len(),
            faces,
            uv_sets: vec![set],
            materials: if materials.is_empty() { Vec::new() } else { of_faces },
            ..Part::default()
        };
        model.surface = Surface { parts: vec![part], materials, ..Surface::default() };
        true
    }
}
