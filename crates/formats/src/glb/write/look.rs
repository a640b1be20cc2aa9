//! Materials of a surface as those of metallic-roughness.

use std::collections::HashMap;

use cager_geometry::surface::{Channel, Component, Material, TILES, Texture};
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
    /// `uv_set` is the number of the texture coordinates of a name, of what has a material.
    pub(super) fn of(materials: &[Material], uv_set: impl Fn(u32, &str) -> usize) -> Self {
        let mut looks = Self::default();
        let look = |(k, material)| looks.look(material, |name: &str| uv_set(k, name));
        let all = (0..).zip(materials).map(look).collect();
        looks.materials = all;
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

    fn look(&mut self, material: &Material, uv_set: impl Fn(&str) -> usize) -> Value {
        let [red, green, blue] = material.base_color;
        let mut pbr = json!({
            "baseColorFactor": [red, green, blue, material.opacity],
            "metallicFactor": material.metalness,
            "roughnessFactor": material.roughness,
        });
        let mut look = json!({ "name": material.name, "doubleSided": true });
        let mut texture = |texture: &Texture| self.texture(&texture.path, uv_set(&texture.uv_set));
        if let Some(found) = picture(material, Channel::BaseColor) {
            pbr["baseColorFactor"] = json!([1.0, 1.0, 1.0, material.opacity]);
            pbr["baseColorTexture"] = texture(found);
        }
        if let Some(found) = shared_picture(material) {
            pbr["metallicRoughnessTexture"] = texture(found);
            pbr["roughnessFactor"] = json!(1.0);
            if picture(material, Channel::Metalness).is_some() {
                pbr["metallicFactor"] = json!(1.0);
            }
        }
        if let Some(found) = picture(material, Channel::Normal) {
            look["normalTexture"] = texture(found);
        }
        if let Some(found) = picture(material, Channel::Emission) {
            look["emissiveTexture"] = texture(found);
            look["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
        }
        if material.opacity < 1.0 || picture(material, Channel::Opacity).is_some() {
            look["alphaMode"] = json!("BLEND");
        }
        look["pbrMetallicRoughness"] = pbr;
        look
    }

    fn texture(&mut self, path: &str, uv_set: usize) -> Value {
        let index = *self.numbers.entry(path.to_owned()).or_insert_with(|| {
            self.pictures.push(path.to_owned());
            self.pictures.len() - 1
        });
        if uv_set == 0 { json!({ "index": index }) } else { json!({ "index": index, "texCoord": uv_set }) }
    }
}

/// Pictures that are left out: the format has roughness and metalness in one, opacity in that of
/// the colour, and no tiles.
pub(crate) fn lost_pictures(materials: &[Material]) -> Vec<&'static str> {
    let any = |is_lost: &dyn Fn(&Material) -> bool| materials.iter().any(is_lost);
    let mut lost = Vec::new();
    if any(&|material| material.textures.iter().any(is_tiled)) {
        lost.push("textures in tiles (UDIM)");
    }
    let has = |material: &Material, channel| picture(material, channel).is_some();
    if any(&|material| {
        let is_there = has(material, Channel::Roughness) || has(material, Channel::Metalness);
        is_there && shared_picture(material).is_none()
    }) {
        lost.push("textures of roughness or metalness that are not the green and the blue of one picture");
    }
    if any(&|material| {
        let opacity = picture(material, Channel::Opacity);
        let base = picture(material, Channel::BaseColor);
        opacity.is_some_and(|opacity| {
            material.component(opacity) != Some(Component::Alpha)
                || base.is_none_or(|base| (&base.path, &base.uv_set) != (&opacity.path, &opacity.uv_set))
        })
    }) {
        lost.push("textures of opacity apart from the alpha of that of the colour");
    }
    lost
}

fn picture(material: &Material, channel: Channel) -> Option<&Texture> {
    material.textures.iter().find(|texture| texture.channel == channel && !is_tiled(texture))
}

/// Whether it has a picture for each square of texture coordinates.
fn is_tiled(texture: &Texture) -> bool {
    texture.path.contains(TILES)
}

/// The picture whose green is roughness and whose blue is metalness, or whose roughness is all the same
/// in any component, where nothing is metal.
fn shared_picture(material: &Material) -> Option<&Texture> {
    let rough = picture(material, Channel::Roughness)?;
    let is_fit = match picture(material, Channel::Metalness) {
        None => material.metalness == 0.0 && matches!(rough.component, None | Some(Component::Green)),
        Some(metal) => {
            let is_one = (&metal.path, &metal.uv_set) == (&rough.path, &rough.uv_set);
            let components = [rough, metal].map(|texture| material.component(texture));
            is_one && components == [Some(Component::Green), Some(Component::Blue)]
        }
    };
    is_fit.then_some(rough)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_are_left_out_and_told() {
        let textures =
            vec![Texture::new(Channel::BaseColor, "skin.<UDIM>.png"), Texture::new(Channel::Normal, "n.png")];
        let material = Material { base_color: [0.5; 3], textures, ..Material::default() };
        let looks = Looks::of(std::slice::from_ref(&material), |_, _| 0);
        assert_eq!(looks.pictures, ["n.png"]);
        let pbr = &looks.materials[0]["pbrMetallicRoughness"];
        assert_eq!((pbr.get("baseColorTexture"), &pbr["baseColorFactor"][0]), (None, &json!(0.5)));
        assert_eq!(lost_pictures(&[material]), ["textures in tiles (UDIM)"]);
    }
}
