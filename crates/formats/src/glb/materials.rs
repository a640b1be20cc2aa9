//! Materials of metallic-roughness, as far as those of other formats are like them, and the
//! pictures that they name.

use cager_geometry::surface::{Channel, Component, Material, Texture};
use gltf::json::Value;
use gltf::json::mesh::Semantic;
use percent_encoding::percent_decode_str;

use super::document::items;

/// Bytes of the names of pictures: those of any file, and of each byte of its JSON.
const NAMES_OF_ANY_FILE: usize = 1 << 16;
const NAMES_PER_BYTE: usize = 4;

/// Images whose names are compared.
const MOST_NAMED: usize = 1 << 10;

/// A material of a file.
pub(super) struct Look {
    pub(super) material: Material,
    /// How its pictures move texture coordinates, and those of which sets.
    pub(super) moved: Option<(Transform, Vec<u64>)>,
    /// Pictures that lie in the file itself.
    pub(super) embedded: Vec<Embedded>,
    /// What else of it is not kept.
    pub(super) dropped: Vec<&'static str>,
}

/// A picture that lies in the file itself.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Embedded {
    pub(super) path: String,
    /// The buffer view that has its bytes, where it is no text.
    pub(super) view: Option<usize>,
}

/// `KHR_texture_transform`: scaled, then turned counter-clockwise in the picture, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform {
    offset: [f64; 2],
    rotation: f64,
    scale: [f64; 2],
}

impl Transform {
    const NONE: Self = Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2] };

    fn of(extension: &Value) -> Self {
        let rotation = number(&extension["rotation"]).unwrap_or(0.0);
        Self {
            offset: numbers(&extension["offset"]).unwrap_or([0.0; 2]),
            rotation,
            scale: numbers(&extension["scale"]).unwrap_or([1.0; 2]),
        }
    }

    /// Coordinates with `v` downwards.
    pub(super) fn apply(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let ([u, v], (sin, cos)) = ([u * self.scale[0], v * self.scale[1]], self.rotation.sin_cos());
        [cos * u + sin * v + self.offset[0], cos * v - sin * u + self.offset[1]]
    }
}

/// The materials of a document of so many bytes.
pub(super) fn materials(document: &Value, length: usize) -> Vec<Look> {
    let mut room = NAMES_OF_ANY_FILE + NAMES_PER_BYTE * length;
    items(document, "materials").iter().enumerate().map(|(k, value)| look(document, k, value, &mut room)).collect()
}

fn look(document: &Value, k: usize, value: &Value, room: &mut usize) -> Look {
    let pbr = &value["pbrMetallicRoughness"];
    let [red, green, blue, alpha] = numbers(&pbr["baseColorFactor"]).unwrap_or([1.0; 4]);
    let is_opaque = matches!(value["alphaMode"].as_str(), None | Some("OPAQUE"));
    let metalness = number(&pbr["metallicFactor"]).unwrap_or(1.0);
    let shines = numbers(&value["emissiveFactor"]).is_some_and(|factor: [f64; 3]| factor != [0.0; 3]);
    let name = value["name"].as_str().map_or_else(|| format!("material_{k}"), str::to_owned);
    let mut look = Look {
        material: Material {
            name,
            base_color: [red, green, blue].map(fraction),
            opacity: if is_opaque { 1.0 } else { fraction(alpha) },
            roughness: number(&pbr["roughnessFactor"]).map_or(1.0, fraction),
            metalness: fraction(metalness),
            textures: Vec::new(),
        },
        moved: None,
        embedded: Vec::new(),
        dropped: Vec::new(),
    };
    let mut transforms: Vec<(Transform, u64)> = Vec::new();
    // The red, green and blue of a picture are its colour, roughness and metalness.
    for (channel, info, is_used) in [
        (Channel::BaseColor, &pbr["baseColorTexture"], true),
        (Channel::Opacity, &pbr["baseColorTexture"], !is_opaque),
        (Channel::Roughness, &pbr["metallicRoughnessTexture"], true),
        (Channel::Metalness, &pbr["metallicRoughnessTexture"], metalness > 0.0),
        (Channel::Normal, &value["normalTexture"], true),
        (Channel::Emission, &value["emissiveTexture"], shines),
    ] {
        let Some((path, embedded)) = index(&info["index"]).filter(|_| is_used).and_then(|k| picture(document, k))
        else {
            continue;
        };
        let Some(left) = room.checked_sub(path.len()) else {
            look.dropped.push("textures of long names");
            continue;
        };
        *room = left;
        look.embedded.extend(embedded.map(|view| Embedded { path: path.clone(), view }));
        let extension = &info["extensions"]["KHR_texture_transform"];
        let set = extension["texCoord"].as_u64().or(info["texCoord"].as_u64()).unwrap_or(0);
        let uv_set = if set == 0 { String::new() } else { Semantic::TexCoords(set as u32).to_string() };
        let component = match channel {
            Channel::Opacity => Some(Component::Alpha),
            Channel::Roughness => Some(Component::Green),
            Channel::Metalness => Some(Component::Blue),
            Channel::BaseColor | Channel::Normal | Channel::Emission => None,
        };
        look.material.textures.push(Texture { uv_set, component, ..Texture::new(channel, path) });
        transforms.push((Transform::of(extension), set));
    }
    if value["occlusionTexture"].is_object() {
        look.dropped.push("textures of occlusion");
    }
    look.material.forget_usual_components();
    if let Some(&(first, _)) = transforms.first() {
        if transforms.iter().any(|&(other, _)| other != first) {
            look.dropped.push("places of textures that differ in one material (KHR_texture_transform)");
        } else if first != Transform::NONE {
            look.moved = Some((first, transforms.into_iter().map(|(_, set)| set).collect()));
        }
    }
    look
}

/// The name of the picture of a texture, and where its bytes are if it lies in the file itself.
fn picture(document: &Value, texture: usize) -> Option<(String, Option<Option<usize>>)> {
    let texture = items(document, "textures").get(texture)?;
    // Formats that need an extension have it there.
    let others = texture["extensions"].as_object().into_iter().flat_map(|others| others.values());
    let source = index(&texture["source"]).or_else(|| others.into_iter().find_map(|other| index(&other["source"])))?;
    let image = items(document, "images").get(source)?;
    if let Some(uri) = image["uri"].as_str().filter(|uri| !uri.starts_with("data:")) {
        return Some((percent_decode_str(uri).decode_utf8_lossy().replace('\\', "/"), None));
    }
    let uri = image["uri"].as_str().unwrap_or_default();
    let kind = image["mimeType"].as_str().or_else(|| uri.strip_prefix("data:")?.split([';', ',']).next());
    let extension = match kind {
        Some("image/jpeg") => "jpg",
        Some("image/webp") => "webp",
        Some("image/ktx2") => "ktx2",
        _ => "png",
    };
    let name = image["name"].as_str().filter(|name| !name.is_empty());
    let name = name.map_or_else(|| format!("image_{source}"), |name| name.replace(['/', '\\'], "_"));
    // Many programs call all of them the same.
    let is_taken = |other: &Value| other["name"].as_str() == image["name"].as_str();
    let others = items(document, "images").iter().take(MOST_NAMED.min(source));
    let name = if image["name"].is_string() && others.into_iter().any(is_taken) {
        match name.rsplit_once('.') {
            Some((stem, end)) => format!("{stem}_{source}.{end}"),
            None => format!("{name}_{source}"),
        }
    } else {
        name
    };
    let has_extension = name.rsplit_once('.').is_some_and(|(_, end)| end.eq_ignore_ascii_case(extension));
    Some((if has_extension { name } else { format!("{name}.{extension}") }, Some(index(&image["bufferView"]))))
}

fn index(value: &Value) -> Option<usize> {
    usize::try_from(value.as_u64()?).ok()
}

fn number(value: &Value) -> Option<f64> {
    value.as_f64().filter(|x| x.is_finite())
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let found: Vec<f64> = value.as_array()?.iter().take(N + 1).map_while(number).collect();
    found.try_into().ok()
}

fn fraction(x: f64) -> f32 {
    x.clamp(0.0, 1.0) as f32
}
