//! The materials of faces.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use cager_geometry::surface::{Channel, MOST_PICTURES, Material, NO_MATERIAL, Picture, Texture};
use ufbx::{MaterialMap, Mesh, Node};

use crate::pictures::is_picture;

/// Those of all meshes that are read.
#[derive(Default)]
pub(super) struct Materials {
    pub(super) list: Vec<Material>,
    /// Those that lie in the file and are named, once each.
    pub(super) pictures: Vec<Picture>,
    /// Places in the list by numbers in the scene.
    known: HashMap<u32, u32>,
}

impl Materials {
    /// The material of each of these faces; empty where none has one. Copies of a mesh may have
    /// others than the mesh.
    pub(super) fn of_faces(&mut self, node: &Node, mesh: &Mesh, faces: &[u32]) -> Vec<u32> {
        let own = if node.materials.is_empty() { &mesh.materials } else { &node.materials };
        let mut places: Vec<Option<u32>> = vec![None; own.len()];
        let first = mesh.uv_sets.as_ref().first().map_or("", |set| &set.name);
        let mut material = |&face: &u32| {
            // Where all faces have the first one, some files have no list.
            let slot = mesh.face_material.as_ref().get(face as usize).map_or(0, |&slot| slot as usize);
            let Some(stored) = own.as_ref().get(slot) else { return NO_MATERIAL };
            *places[slot].get_or_insert_with(|| {
                *self.known.entry(stored.element.typed_id).or_insert_with(|| {
                    self.list.push(read(stored, first, &mut self.pictures));
                    self.list.len() as u32 - 1
                })
            })
        };
        let all: Vec<u32> = faces.iter().map(&mut material).collect();
        if all.iter().all(|&material| material == NO_MATERIAL) { Vec::new() } else { all }
    }
}

/// A material of a mesh whose first texture coordinates have a name; adds the pictures that lie in the file.
fn read(stored: &ufbx::Material, first: &str, pictures: &mut Vec<Picture>) -> Material {
    let (usual, maps) = (Material::default(), &stored.pbr);
    let value = |map: &MaterialMap, usual: f32| match map.value_vec4.x as f32 {
        value if map.has_value && value.is_finite() => value.clamp(0.0, 1.0),
        _ => usual,
    };
    let color = &maps.base_color.value_vec4;
    let factor = if maps.base_factor.has_value { maps.base_factor.value_vec4.x } else { 1.0 };
    let base_color = [color.x, color.y, color.z].map(|x| (factor * x) as f32);
    let is_said = maps.base_color.has_value && base_color.iter().all(|x| x.is_finite());
    let textures = [
        (Channel::BaseColor, &maps.base_color),
        (Channel::Opacity, &maps.opacity),
        (Channel::Roughness, &maps.roughness),
        (Channel::Metalness, &maps.metalness),
        (Channel::Normal, &maps.normal_map),
        (Channel::Emission, &maps.emission_color),
    ];
    Material {
        name: stored.element.name.to_string(),
        base_color: if is_said { base_color } else { usual.base_color },
        opacity: value(&maps.opacity, usual.opacity),
        roughness: value(&maps.roughness, usual.roughness),
        metalness: value(&maps.metalness, usual.metalness),
        textures: textures
            .into_iter()
            .filter_map(|(channel, map)| {
                let (mut path, found) = picture(map)?;
                if is_picture(Path::new(&path), &found.content) {
                    path = embed(pictures, &path, &found.content);
                }
                let uv_set = if &*found.uv_set == first { String::new() } else { found.uv_set.to_string() };
                Some(Texture { uv_set, ..Texture::new(channel, path) })
            })
            .collect(),
    }
}

/// The file of a picture, of several layers the lowest, and what is said of it.
fn picture(map: &MaterialMap) -> Option<(String, &ufbx::Texture)> {
    let texture = map.texture.as_deref().filter(|_| map.texture_enabled)?;
    let texture = texture.file_textures.as_ref().first().map_or(texture, |first| &**first);
    let names = [&texture.relative_filename, &texture.filename, &texture.absolute_filename];
    let path = names.into_iter().find(|name| !name.is_empty())?;
    Some((path.replace('\\', "/"), texture))
}

/// Adds a picture that lies in the file, once, as far as there is room; gives its path, with a number where another
/// one has the same.
fn embed(pictures: &mut Vec<Picture>, path: &str, bytes: &[u8]) -> String {
    let end = path.rfind('.').filter(|&dot| !path[dot..].contains('/')).unwrap_or(path.len());
    let (stem, extension) = path.split_at(end);
    for k in 1.. {
        let name = if k == 1 { path.to_owned() } else { format!("{stem}_{k}{extension}") };
        match pictures.iter().find(|known| known.path == name) {
            Some(known) if known.bytes[..] != *bytes => continue,
            None if pictures.len() < MOST_PICTURES => {
                pictures.push(Picture { path: name.clone(), bytes: Arc::from(bytes) });
            }
            _ => {}
        }
        return name;
    }
    unreachable!("numbers do not end")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_pictures_of_one_path_are_numbered_and_too_many_are_not_kept() {
        let mut pictures = Vec::new();
        let mut embed = |path: &str, bytes: &[u8]| embed(&mut pictures, path, bytes);
        for (path, bytes, known) in [
            ("maps/skin.png", b"1", "maps/skin.png"),
            ("maps/skin.png", b"2", "maps/skin_2.png"),
            ("maps/skin.png", b"1", "maps/skin.png"),
            ("maps/skin.png", b"2", "maps/skin_2.png"),
            ("a.b/skin", b"3", "a.b/skin"),
            ("a.b/skin", b"4", "a.b/skin_2"),
        ] {
            assert_eq!(embed(path, bytes), known);
        }
        (0..2 * MOST_PICTURES).for_each(|k| drop(embed(&format!("{k}.png"), b"5")));
        assert_eq!(pictures.len(), MOST_PICTURES);
    }
}
