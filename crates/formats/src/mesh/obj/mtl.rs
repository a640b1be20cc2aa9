//! Materials of Wavefront files (`.mtl`), with the lines for roughness and metalness that Blender and others write.

use cager_geometry::surface::{Channel, Material, Texture};

use crate::names::Names;
use crate::text::{Lines, number, words};

/// Specular exponent of a surface without roughness, as Blender has it.
const SHARPEST: f64 = 1_000.0;
/// Most materials and pictures that are kept of a file.
const MOST: usize = 1 << 16;

/// What names a picture, and for what.
const MAPS: [(&str, Channel); 8] = [
    ("map_Kd", Channel::BaseColor),
    ("map_d", Channel::Opacity),
    ("map_Pr", Channel::Roughness),
    ("map_Pm", Channel::Metalness),
    ("map_Ke", Channel::Emission),
    ("norm", Channel::Normal),
    ("map_Bump", Channel::Normal),
    ("bump", Channel::Normal),
];

/// The materials of a file; lines that say nothing of these are passed over.
pub(super) fn read(bytes: &[u8]) -> Vec<Material> {
    let mut materials: Vec<Material> = Vec::new();
    for line in Lines::new(bytes) {
        let keyword = words(line).next().unwrap_or_default();
        let rest = line[keyword.len()..].trim_ascii();
        if keyword == b"newmtl" {
            if materials.len() < MOST {
                materials.push(Material { name: String::from_utf8_lossy(rest).into_owned(), ..Material::default() });
            }
            continue;
        }
        let Some(material) = materials.last_mut() else { continue };
        let numbers: Vec<f32> = words(rest).map_while(number).map(|x| x as f32).filter(|x| x.is_finite()).collect();
        match (keyword, numbers.as_slice()) {
            (b"Kd", &[red, green, blue]) => material.base_color = [red, green, blue],
            (b"d", &[opacity]) => material.opacity = opacity,
            (b"Tr", &[transparency]) => material.opacity = 1.0 - transparency,
            (b"Ns", &[exponent]) => {
                material.roughness = 1.0 - (f64::from(exponent) / SHARPEST).clamp(0.0, 1.0).sqrt() as f32;
            }
            (b"Pr", &[roughness]) => material.roughness = roughness,
            (b"Pm", &[metalness]) => material.metalness = metalness,
            _ => {
                let channel = MAPS.iter().find(|(name, _)| name.as_bytes().eq_ignore_ascii_case(keyword));
                let path = file_of(rest);
                if let Some(&(_, channel)) = channel
                    && !path.is_empty()
                    && material.textures.iter().all(|texture| texture.channel != channel)
                {
                    material.textures.push(Texture::new(channel, path));
                }
            }
        }
    }
    materials
}

/// The file behind the options of a line such as `-bm 0.5 -o 0 0 normals of face.png`.
fn file_of(line: &[u8]) -> String {
    let mut rest = line;
    while rest.first() == Some(&b'-') {
        let option = words(rest).next().unwrap_or_default();
        rest = rest[option.len()..].trim_ascii_start();
        // Its values: numbers, `on`, `off`, or a letter.
        loop {
            let word = words(rest).next().unwrap_or_default();
            let is_value = number(word).is_some() || word == b"on" || word == b"off" || word.len() == 1;
            if !is_value || word.len() == rest.len() {
                break;
            }
            rest = rest[word.len()..].trim_ascii_start();
        }
    }
    String::from_utf8_lossy(rest).replace('\\', "/")
}

/// Materials as a file, with the pictures of a frame.
pub(crate) fn materials_text(materials: &[Material], frame: usize) -> String {
    let mut text = String::new();
    for (material, name) in materials.iter().zip(names(materials)) {
        let [red, green, blue] = material.base_color;
        let exponent = SHARPEST * (1.0 - f64::from(material.roughness)).powi(2);
        text += &format!(
            "newmtl {}\nKd {red} {green} {blue}\nd {}\nNs {exponent}\nPr {}\nPm {}\nillum 2\n",
            name, material.opacity, material.roughness, material.metalness
        );
        for texture in &material.textures {
            let name = MAPS.iter().find(|(_, channel)| *channel == texture.channel).map_or("map_Kd", |(name, _)| name);
            text += &format!("{name} {}\n", one_line(texture.at(frame)));
        }
        text.push('\n');
    }
    text
}

/// The names of materials in a file, each once.
pub(super) fn names(materials: &[Material]) -> Vec<String> {
    let mut names = Names::default();
    materials.iter().map(|material| names.add(&one_line(&material.name))).collect()
}

/// A name as one line has it.
pub(super) fn one_line(name: &str) -> String {
    name.trim().replace(char::is_control, "_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_come_back_and_options_of_pictures_are_passed_over() {
        let text = b"# none\nKd 1 1 1\nnewmtl old gold\nKd 0.9 0.7 0.1\nd 0.5\nPr 0.25\nPm 1\nmap_Kd -s 2 2 1 \
                     ..\\tex\\gold base.png\n\
            norm -bm 0.5 n.png\nmap_Kd second.png\nnewmtl b\nNs 250\nTr 0.25\nKd 1 x 2\n";
        let read_back = read(text);
        assert_eq!(read_back.len(), 2);
        let gold = &read_back[0];
        assert_eq!((gold.name.as_str(), gold.base_color, gold.opacity), ("old gold", [0.9, 0.7, 0.1], 0.5));
        assert_eq!((gold.roughness, gold.metalness), (0.25, 1.0));
        let paths: Vec<(Channel, &str)> = gold.textures.iter().map(|t| (t.channel, t.path.as_str())).collect();
        assert_eq!(paths, [(Channel::BaseColor, "../tex/gold base.png"), (Channel::Normal, "n.png")]);
        assert_eq!((read_back[1].roughness, read_back[1].opacity), (0.5, 0.75));
        assert_eq!(read(materials_text(&read_back, 0).as_bytes()), read_back);
    }
}
