//! Materials of a layer: UsdPreviewSurface, with pictures as the specification has them.

use std::io::{self, Seek, Write};

use cager_geometry::surface::{Channel, Component, Material, Part, Surface, Texture};

use super::encoder::Encoder;
use super::faces::uv_names;
use super::property::{Prim, Property};
use super::tree::identifier;
use crate::names::Names;
use crate::usd::binary::kind;

/// The group of all materials.
pub(super) const GROUP: &str = "_materials";
/// Where the texture coordinates are read, and the shader of the surface.
const READER: &str = "uvs";
const SHADER: &str = "surface";
/// Texture coordinates that have no name.
pub(super) const USUAL_UVS: &str = "st";

/// The materials below a root of this path, and the path of each; frames are at these time codes.
pub(super) fn materials<W: Write + Seek>(
    encoder: &mut Encoder<W>,
    surface: &Surface,
    root: &str,
    codes: &[f64],
) -> io::Result<(Prim, Vec<String>)> {
    let mut group = Prim { name: GROUP.to_owned(), type_name: "Scope", ..Prim::default() };
    let (mut names, mut paths) = (Names::default(), Vec::new());
    for (k, material) in (0..).zip(&surface.materials) {
        let name = names.add(&identifier(&material.name));
        let path = format!("{root}/{GROUP}/{name}");
        let parts = || surface.parts.iter().filter(|part| !part.uv_sets.is_empty() && part.materials.contains(&k));
        // Of a name that no part has, the first.
        let uvs = |name: &str| {
            let named = |part: &Part| Some((part.uv_sets.iter().position(|set| set.name == name)?, uv_names(part)));
            let found = parts().find_map(named).or_else(|| parts().next().map(|part| (0, uv_names(part))));
            found.map_or_else(|| USUAL_UVS.to_owned(), |(set, mut names)| names.swap_remove(set))
        };
        let children = shaders(encoder, material, (&path, uvs), codes)?;
        let output = Property::new("token", "outputs:surface").from(format!("{path}/{SHADER}.outputs:surface"));
        group.children.push(Prim {
            name,
            type_name: "Material",
            properties: vec![output],
            children,
            ..Prim::default()
        });
        paths.push(path);
    }
    Ok((group, paths))
}

fn shaders<W: Write + Seek>(
    encoder: &mut Encoder<W>,
    material: &Material,
    (path, uvs): (&str, impl Fn(&str) -> String),
    codes: &[f64],
) -> io::Result<Vec<Prim>> {
    let bytes = |numbers: &[f32]| -> Vec<u8> { numbers.iter().flat_map(|x| x.to_le_bytes()).collect() };
    let base_color = encoder.put(kind::VEC3F, &bytes(&material.base_color))?;
    let mut inputs = vec![
        (Channel::BaseColor, Property::new("color3f", "inputs:diffuseColor").value(base_color)),
        (Channel::Opacity, Property::new("float", "inputs:opacity").value(encoder.float(material.opacity))),
        (Channel::Roughness, Property::new("float", "inputs:roughness").value(encoder.float(material.roughness))),
        (Channel::Metalness, Property::new("float", "inputs:metallic").value(encoder.float(material.metalness))),
    ];
    let texture_of = |channel| material.textures.iter().find(|texture| texture.channel == channel);
    for (channel, type_name, name) in
        [(Channel::Normal, "normal3f", "inputs:normal"), (Channel::Emission, "color3f", "inputs:emissiveColor")]
    {
        inputs.extend(texture_of(channel).map(|_| (channel, Property::new(type_name, name))));
    }
    let mut properties = vec![Property::fixed("info:id", "UsdPreviewSurface")];
    // Of texture coordinates, which are told apart by their names.
    let (mut pictures, mut readers) = (Vec::new(), Vec::<(String, String)>::new());
    for (channel, mut input) in inputs {
        if let Some(texture) = texture_of(channel) {
            let output = match material.component(texture) {
                None => "rgb",
                Some(Component::Red) => "r",
                Some(Component::Green) => "g",
                Some(Component::Blue) => "b",
                Some(Component::Alpha) => "a",
            };
            let uvs = uvs(&texture.uv_set);
            let reader = match readers.iter().position(|(known, _)| *known == uvs) {
                Some(known) => readers[known].1.clone(),
                None => {
                    let reader =
                        if readers.is_empty() { READER.to_owned() } else { format!("{READER}_{}", readers.len()) };
                    readers.push((uvs, reader.clone()));
                    reader
                }
            };
            let name = format!("{channel:?}");
            let output_type = if output == "rgb" { "float3" } else { "float" };
            let output = format!("outputs:{output}");
            input = input.from(format!("{path}/{name}.{output}"));
            let is_color = matches!(channel, Channel::BaseColor | Channel::Emission);
            let mut picture = vec![
                Property::fixed("info:id", "UsdUVTexture"),
                files(encoder, texture, codes)?,
                Property::new("token", "inputs:sourceColorSpace").token(if is_color { "sRGB" } else { "raw" }),
                Property::new("token", "inputs:wrapS").token("repeat"),
                Property::new("token", "inputs:wrapT").token("repeat"),
                Property::new("float2", "inputs:st").from(format!("{path}/{reader}.outputs:result")),
                Property::new(output_type, output),
            ];
            if channel == Channel::Normal {
                // From 0 … 1 to −1 … 1.
                let scale = encoder.put(kind::VEC4F, &bytes(&[2.0, 2.0, 2.0, 1.0]))?;
                let bias = encoder.put(kind::VEC4F, &bytes(&[-1.0, -1.0, -1.0, 0.0]))?;
                picture.push(Property::new("float4", "inputs:scale").value(scale));
                picture.push(Property::new("float4", "inputs:bias").value(bias));
            }
            pictures.push(Prim { name, type_name: "Shader", properties: picture, ..Prim::default() });
        }
        properties.push(input);
    }
    properties.push(Property::new("token", "outputs:surface"));
    let mut all = vec![Prim { name: SHADER.to_owned(), type_name: "Shader", properties, ..Prim::default() }];
    all.append(&mut pictures);
    for (uvs, name) in readers {
        let properties = vec![
            Property::fixed("info:id", "UsdPrimvarReader_float2"),
            Property::new("string", "inputs:varname").value(encoder.string(&uvs)),
            Property::new("float2", "outputs:result"),
        ];
        all.push(Prim { name, type_name: "Shader", properties, ..Prim::default() });
    }
    Ok(all)
}

/// The file of a picture, of a sequence that of each time code where it becomes another one.
fn files<W: Write + Seek>(encoder: &mut Encoder<W>, texture: &Texture, codes: &[f64]) -> io::Result<Property> {
    let property = Property::new("asset", "inputs:file").value(encoder.asset(&one_line(&texture.path)));
    if texture.frames.is_empty() {
        return Ok(property);
    }
    let is_new = |&k: &usize| k == 0 || texture.at(k) != texture.at(k - 1);
    let (times, names): (Vec<f64>, Vec<&str>) =
        (0..codes.len()).filter(is_new).map(|k| (codes[k], texture.at(k))).unzip();
    let times = encoder.times(&times)?;
    let values: Vec<u64> = names.into_iter().map(|name| encoder.asset(&one_line(name))).collect();
    Ok(property.samples(encoder.samples(times, &values)?))
}

/// A path as tables of names have it.
fn one_line(path: &str) -> String {
    path.chars().map(|c| if c.is_control() { '_' } else { c }).collect()
}
