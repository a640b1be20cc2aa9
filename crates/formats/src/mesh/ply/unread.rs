//! Properties and elements of PLY files that models do not keep.

use super::super::parsed::Parsed;
use super::header::{Element, Header};
use super::surface;
use crate::dropped::{counted, listed};

/// Tells what the header promises beside positions, colours of points and corners of faces.
pub(super) fn tell(header: &Header<'_>, parsed: &mut Parsed, is_dressed: bool) {
    let has_colors = !parsed.model.colors.is_empty();
    let dropped = &mut parsed.dropped;
    for element in header.elements.iter().filter(|element| element.count > 0) {
        match element.name.as_str() {
            "vertex" => {
                let is_other = |_: usize, name: &str| match name {
                    "x" | "y" | "z" => false,
                    "red" | "green" | "blue" => !has_colors,
                    name if is_dressed && matches!(surface::plain(name), "s" | "t") => false,
                    _ => true,
                };
                if let Some((count, names)) = others(element, is_other) {
                    let all = element.properties.len();
                    dropped.add(format!("{count} of {all} properties ({names}) of its vertices"));
                }
            }
            "face" | "tristrips" => {
                let corners = element.corners().ok();
                let is_read = |name: &str| is_dressed && matches!(name, "texcoord" | "texnumber");
                if let Some((count, names)) = others(element, |k, name| Some(k) != corners && !is_read(name)) {
                    let properties = if count == 1 { "property" } else { "properties" };
                    dropped.add_on_faces(format!("{count} {properties} ({names}) of its faces"));
                }
            }
            name => {
                let items = counted(usize::try_from(element.count).unwrap_or(usize::MAX), "item");
                dropped.add(format!("{items} of {}", listed([name.as_bytes()])));
            }
        }
    }
    if !header.textures.is_empty() && !is_dressed {
        dropped.add("its texture (TextureFile)");
    }
}

/// How many properties are not read, by their places and names, and what they are called.
fn others(element: &Element, is_other: impl Fn(usize, &str) -> bool) -> Option<(usize, String)> {
    let all = element.properties.iter().enumerate();
    let names: Vec<&[u8]> = all
        .filter(|(k, property)| is_other(*k, &property.name))
        .map(|(_, property)| property.name.as_bytes())
        .collect();
    (!names.is_empty()).then(|| (names.len(), listed(names)))
}
