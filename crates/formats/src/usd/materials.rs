//! Materials of faces: what is bound to meshes, to what lies above them and to subsets of faces.

use std::collections::HashMap;

use cager_geometry::surface::{Channel, Component, FaceGroup, Material, NO_MATERIAL, Part, Texture};

use super::layer::{Kind, Layer};
use super::surface::Faces;
use crate::error::Fault;
use crate::frames::PictureSequence;
use crate::scene::{Track, Value, ancestry};

/// Relationships to a material; what is for previews before what is for rendering alone.
const BINDINGS: [&str; 3] = ["material:binding", "material:binding:preview", "material:binding:full"];
/// Connections from an input to where its value is; programs write two or three.
const MOST_CONNECTIONS: usize = 16;
/// Inputs of a surface, of which pictures may be.
const INPUTS: [(&str, Channel); 6] = [
    ("inputs:diffuseColor", Channel::BaseColor),
    ("inputs:opacity", Channel::Opacity),
    ("inputs:roughness", Channel::Roughness),
    ("inputs:metallic", Channel::Metalness),
    ("inputs:normal", Channel::Normal),
    ("inputs:emissiveColor", Channel::Emission),
];

/// Outputs of a picture that are one number.
const COMPONENTS: [(&str, Component); 4] = [
    ("outputs:r", Component::Red),
    ("outputs:g", Component::Green),
    ("outputs:b", Component::Blue),
    ("outputs:a", Component::Alpha),
];

/// The materials of a layer that are in use.
pub(super) struct Materials {
    pub(super) list: Vec<Material>,
    /// Those that are kept by name alone.
    pub(super) names_alone: usize,
    /// Times of the frames whose pictures are read; none of a model.
    times: Vec<f64>,
    numbers: HashMap<(usize, usize), u32>,
    /// The subsets of each mesh.
    subsets: HashMap<usize, Vec<usize>>,
}

impl Materials {
    /// The pictures of frames at these times, where a material has other ones in some of them; the
    /// materials of these meshes have the places that they have in a model of these.
    pub(super) fn sequences(
        layer: &mut Layer<'_>,
        meshes: &[usize],
        times: &[f64],
    ) -> Result<Vec<PictureSequence>, Fault> {
        let kinds = layer.prims.iter().enumerate().filter(|(_, prim)| prim.kind == Kind::Shading && prim.is_there);
        let shading: Vec<usize> = kinds.map(|(k, _)| k).collect();
        let mut is_moving = false;
        for &prim in &shading {
            is_moving |= layer.attribute(prim, "inputs:file")?.values.len() > 1;
        }
        let mut sequences = Vec::new();
        let mut materials = Self { times: times.to_vec(), ..Self::new(layer) };
        for &mesh in meshes.iter().filter(|_| is_moving) {
            materials.whole(layer, mesh, "")?;
            for (subset, _) in materials.face_subsets(layer, mesh)? {
                materials.bound(layer, subset, "")?;
            }
        }
        // By their names, where frames are in a file without what is bound to what.
        let is_bound = !materials.list.is_empty();
        for &prim in shading.iter().filter(|_| is_moving && !is_bound) {
            if layer.source.target(prim, "outputs:surface")?.is_some() {
                materials.number(layer, prim, "");
            }
        }
        for (place, Material { name, textures, .. }) in materials.list.into_iter().enumerate() {
            let moving = textures.into_iter().filter(|texture| !texture.frames.is_empty());
            sequences.extend(moving.map(|Texture { channel, frames, .. }| PictureSequence {
                material: name.clone(),
                place: Some(place),
                channel,
                paths: frames,
            }));
        }
        Ok(sequences)
    }

    pub(super) fn new(layer: &Layer<'_>) -> Self {
        let mut subsets: HashMap<usize, Vec<usize>> = HashMap::new();
        for (k, _) in layer.prims.iter().enumerate().filter(|(_, prim)| prim.kind == Kind::Subset && prim.is_there) {
            if let Some(mesh) = layer.nodes[k].parent {
                subsets.entry(mesh).or_default().push(k);
            }
        }
        Self { list: Vec::new(), names_alone: 0, times: Vec::new(), numbers: HashMap::new(), subsets }
    }

    /// The materials and the groups of the faces of a mesh.
    pub(super) fn read(
        &mut self,
        layer: &mut Layer<'_>,
        mesh: usize,
        faces: &Faces,
        part: &mut Part,
    ) -> Result<(), Fault> {
        let count = faces.arities.len();
        let first = part.uv_sets.first().map_or("", |set| &set.name).to_owned();
        let whole = self.whole(layer, mesh, &first)?;
        layer.source.reserve(count as u64, 4)?;
        let mut materials = vec![whole; count];
        for (subset, indices) in self.face_subsets(layer, mesh)? {
            let indices = layer.source.integers(indices, faces.most())?;
            let inside = |&face: &i32| usize::try_from(face).ok().filter(|&face| face < count);
            match self.bound(layer, subset, &first)? {
                Some(material) => indices.iter().filter_map(inside).for_each(|face| materials[face] = material),
                None => part.groups.push(FaceGroup {
                    name: String::from_utf8_lossy(&layer.nodes[subset].name).into_owned(),
                    faces: indices.iter().filter_map(inside).map(|face| face as u32).collect(),
                }),
            }
        }
        if materials.iter().any(|&material| material != NO_MATERIAL) {
            part.materials = materials;
        }
        Ok(())
    }

    /// The material of faces of a mesh that are in no subset.
    fn whole(&mut self, layer: &mut Layer<'_>, mesh: usize, first: &str) -> Result<u32, Fault> {
        for prim in ancestry(&layer.nodes, mesh).collect::<Vec<_>>() {
            if let Some(material) = self.bound(layer, prim, first)? {
                return Ok(material);
            }
        }
        Ok(NO_MATERIAL)
    }

    /// The subsets of the faces of a mesh, and which faces are in each.
    fn face_subsets(&mut self, layer: &mut Layer<'_>, mesh: usize) -> Result<Vec<(usize, Value)>, Fault> {
        let mut found = Vec::new();
        for subset in self.subsets.remove(&mesh).unwrap_or_default() {
            let Some(indices) = layer.first(subset, "indices")? else { continue };
            let elements = layer.tokens(subset, "elementType", 1)?.unwrap_or_default().concat();
            if matches!(elements.as_str(), "" | "face") {
                found.push((subset, indices));
            }
        }
        Ok(found)
    }

    /// The material that a prim itself is bound to, on a mesh whose first texture coordinates have a name.
    fn bound(&mut self, layer: &mut Layer<'_>, prim: usize, first: &str) -> Result<Option<u32>, Fault> {
        for name in BINDINGS {
            if let Some((material, _)) = layer.source.target(prim, name)? {
                return Ok(Some(self.number(layer, material, first)));
            }
        }
        Ok(None)
    }

    fn number(&mut self, layer: &mut Layer<'_>, prim: usize, first: &str) -> u32 {
        let origin = layer.source.origin(prim);
        if let Some(&number) = self.numbers.get(&origin) {
            return number;
        }
        let name = String::from_utf8_lossy(&layer.nodes[prim].name).into_owned();
        // What cannot be read has a name at least.
        let read = read_material(layer, prim, first, &self.times).unwrap_or_default();
        self.names_alone += usize::from(read.is_none());
        let number = self.list.len() as u32;
        self.list.push(Material { name, ..read.unwrap_or_default() });
        self.numbers.insert(origin, number);
        number
    }
}

/// Where the value of an attribute is: over connections, of which some lead through materials.
fn source(layer: &mut Layer<'_>, prim: usize, name: &str) -> Result<(usize, String), Fault> {
    let mut at = (prim, name.to_owned());
    for _ in 0..MOST_CONNECTIONS {
        match layer.source.target(at.0, &at.1)? {
            Some(next) => at = next,
            None => break,
        }
    }
    Ok(at)
}

/// The name of a file, as seen from the folder of the first layer.
fn asset_path(layer: &mut Layer<'_>, value: Value) -> Result<String, Fault> {
    let path = layer.source.tokens(value, 1)?.concat().replace('\\', "/");
    let path = path.strip_prefix("./").unwrap_or(&path).to_owned();
    let folder = layer.source.folder(value);
    let is_relative = !folder.is_empty() && !path.is_empty() && !path.starts_with('/') && !path.contains(':');
    Ok(if is_relative { format!("{folder}/{path}") } else { path })
}

/// The files that a track names at these times; between two times it names that of the first.
fn frame_paths(layer: &mut Layer<'_>, track: &Track, times: &[f64]) -> Result<Vec<String>, Fault> {
    let mut paths: Vec<String> = Vec::with_capacity(times.len());
    let mut last = None;
    for &time in times {
        let Some((value, ..)) = track.at(time) else { break };
        let path = match paths.last().filter(|_| last == Some(value.0)) {
            Some(path) => path.clone(),
            None => asset_path(layer, value)?,
        };
        layer.source.reserve(path.len() as u64 + 24, 1)?;
        last = Some(value.0);
        paths.push(path);
    }
    Ok(paths)
}

/// A material whose surface is a UsdPreviewSurface, on a mesh with these texture coordinates as the first, with the
/// pictures of frames at these times.
fn read_material(layer: &mut Layer<'_>, prim: usize, first: &str, times: &[f64]) -> Result<Option<Material>, Fault> {
    let (shader, output) = source(layer, prim, "outputs:surface")?;
    let is_a = |layer: &mut Layer<'_>, prim: usize, id: &str| -> Result<bool, Fault> {
        Ok(layer.tokens(prim, "info:id", 1)?.is_some_and(|told| told == [id]))
    };
    if output.is_empty() || !is_a(layer, shader, "UsdPreviewSurface")? {
        return Ok(None);
    }
    let mut material = Material::default();
    for (name, channel) in INPUTS {
        let (prim, attribute) = source(layer, shader, name)?;
        if attribute.starts_with("outputs:") && is_a(layer, prim, "UsdUVTexture")? {
            let (at, file) = source(layer, prim, "inputs:file")?;
            let track = layer.attribute(at, &file)?;
            let path = match track.values.first().or(track.default.as_ref()) {
                Some(&value) => asset_path(layer, value)?,
                None => String::new(),
            };
            if !path.is_empty() {
                let uv_set = uv_set(layer, prim).ok().flatten().filter(|name| name != first).unwrap_or_default();
                let component = COMPONENTS.iter().find(|(name, _)| *name == attribute).map(|(_, component)| *component);
                let mut texture = Texture { uv_set, component, ..Texture::new(channel, path) };
                if track.values.len() > 1 {
                    texture.set_frames(frame_paths(layer, &track, times)?);
                }
                material.textures.push(texture);
            }
        }
        // The value of the surface itself, where a picture takes its place.
        let at = if attribute.starts_with("outputs:") { (shader, name) } else { (prim, attribute.as_str()) };
        let numbers = layer.numbers(at.0, at.1)?.unwrap_or_default();
        let numbers: Vec<f32> = numbers.into_iter().map(|x| x as f32).filter(|x| x.is_finite()).collect();
        match (channel, numbers.as_slice()) {
            (Channel::BaseColor, &[red, green, blue]) => material.base_color = [red, green, blue],
            // Of the specification.
            (Channel::BaseColor, []) if material.textures.is_empty() => material.base_color = [0.18; 3],
            (Channel::Opacity, &[opacity]) => material.opacity = opacity,
            (Channel::Roughness, &[roughness]) => material.roughness = roughness,
            (Channel::Metalness, &[metalness]) => material.metalness = metalness,
            _ => {}
        }
    }
    material.forget_usual_components();
    Ok(Some(material))
}

/// The name of the texture coordinates of a picture, where a UsdPrimvarReader says it.
fn uv_set(layer: &mut Layer<'_>, picture: usize) -> Result<Option<String>, Fault> {
    let mut at = source(layer, picture, "inputs:st")?;
    // What moves them on the way does not change which they are.
    if layer.tokens(at.0, "info:id", 1)?.is_some_and(|told| told == ["UsdTransform2d"]) {
        at = source(layer, at.0, "inputs:in")?;
    }
    if at.0 == picture {
        return Ok(None);
    }
    let (prim, name) = source(layer, at.0, "inputs:varname")?;
    let told = layer.tokens(prim, &name, 1)?;
    Ok(told.map(|told| told.concat()).filter(|name| !name.is_empty()))
}
