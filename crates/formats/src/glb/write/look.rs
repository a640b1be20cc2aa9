//! Materials of a surface as those of metallic-roughness.

use std::collections::HashMap;

use cager_geometry::surface::{Channel, Material};
use percent_encoding::utf8_percent_encode;
use serde_json::{Value, json};

use super::document::ESCAPED;

/// Materials with the pictures that they name.
#[derive(Default)]
pub(super) struct Looks {
    pub(super) materials: Vec<Value>,
    /// The names of pictures, each once.
    pictures: Vec<String>,
    numbers: HashMap<String, usize>,
}

impl Looks {
    pub(super) fn of(materials: &[Material]) -> Self {
        let mut looks = Self::default();
        looks.materials = materials.iter().map(|material| looks.look(material)).collect();
        looks
    }

    /// Puts all into a document.
    pub(super) fn put(self, document: &mut Value) {
        const KEPT: percent_encoding::AsciiSet = ESCAPED.remove(b'/');
        if !self.materials.is_empty() {
            document["materials"] = self.materials.into();
        }
        if !self.pictures.is_empty() {
            let image = |path: &String| json!({ "uri": utf8_percent_encode(path, &KEPT).to_string() });
            document["images"] = self.pictures.iter().map(image).collect();
            document["textures"] = (0..self.pictures.len()).map(|k| json!({ "source": k })).collect();
        }
    }

    fn look(&mut self, material: &Material) -> Value {
        let [red, green, blue] = material.base_color;
        let mut pbr = json!({
            "baseColorFactor": [red, green, blue, material.opacity],
            "metallicFactor": material.metalness,
            "roughnessFactor": material.roughness,
        });
        let mut look = json!({ "name": material.name, "doubleSided": true });
        if let Some(path) = picture(material, Channel::BaseColor) {
            pbr["baseColorFactor"] = json!([1.0, 1.0, 1.0, material.opacity]);
            pbr["baseColorTexture"] = self.texture(path);
        }
        if let Some(path) = shared_picture(material) {
            pbr["metallicRoughnessTexture"] = self.texture(path);
            pbr["roughnessFactor"] = json!(1.0);
            if picture(material, Channel::Metalness).is_some() {
                pbr["metallicFactor"] = json!(1.0);
            }
        }
        if let Some(path) = picture(material, Channel::Normal) {
            look["normalTexture"] = self.texture(path);
        }
        if let Some(path) = picture(material, Channel::Emission) {
            look["emissiveTexture"] = self.texture(path);
            look["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
        }
        if material.opacity < 1.0 || picture(material, Channel::Opacity).is_some() {
            look["alphaMode"] = json!("BLEND");
        }
        look["pbrMetallicRoughness"] = pbr;
        look
    }

    fn texture(&mut self, path: &str) -> Value {
        let index = *self.numbers.entry(path.to_owned()).or_insert_with(|| {
            self.pictures.push(path.to_owned());
            self.pictures.len() - 1
        });
        json!({ "index": index })
    }
}

/// Pictures that are left out: the format has roughness and metalness in one, and opacity in that
/// of the colour.
pub(crate) fn lost_pictures(materials: &[Material]) -> Vec<&'static str> {
    let any = |is_lost: fn(&Material) -> bool| materials.iter().any(is_lost);
    let mut lost = Vec::new();
    if any(|material| {
        let [rough, metal] = [Channel::Roughness, Channel::Metalness].map(|channel| picture(material, channel));
        shared_picture(material).is_none() && (rough.is_some() || metal.is_some())
    }) {
        lost.push("textures of roughness or metalness that are not one picture of both");
    }
    if any(|material| {
        let opacity = picture(material, Channel::Opacity);
        opacity.is_some() && opacity != picture(material, Channel::BaseColor)
    }) {
        lost.push("textures of opacity apart from that of the colour");
    }
    lost
}

fn picture(material: &Material, channel: Channel) -> Option<&str> {
    material.textures.iter().find(|texture| texture.channel == channel).map(|texture| texture.path.as_str())
}

/// The picture of roughness and metalness, where it is one, or where nothing is metal.
fn shared_picture(material: &Material) -> Option<&str> {
    let rough = picture(material, Channel::Roughness)?;
    match picture(material, Channel::Metalness) {
        None => (material.metalness == 0.0).then_some(rough),
        metal => (metal == Some(rough)).then_some(rough),
    }
}
