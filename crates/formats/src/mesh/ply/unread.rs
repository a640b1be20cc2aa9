//! Properties and elements of PLY files that models do not keep.

use super::super::parsed::Parsed;
use super::header::{Element, Header, Property};
use crate::dropped::{counted, listed};

/// Tells what the header promises beside positions, colours of points and corners of faces.
pub(super) fn tell(header: &Header<'_>, parsed: &mut Parsed) {
    let has_colors = !parsed.model.colors.is_empty();
    let dropped = &mut parsed.dropped;
    for element in header.elements.iter().filter(|element| element.count > 0) {
        match element.name.as_str() {
            "vertex" => {
                let is_read = |name: &str| match name {
                    "x" | "y" | "z" => true,
                    "red" | "green" | "blue" => has_colors,
                    _ => false,
                };
                let others = of_element(element, |property| !is_read(&property.name));
                if let Some(others) = others {
                    dropped.add(format!("{others} of its vertices"));
                }
            }
            "face" | "tristrips" => {
                let corners = element.corners().ok();
                let is_other = |k: usize| Some(k) != corners;
                let others: Vec<&Property> =
                    (0..element.properties.len()).filter(|&k| is_other(k)).map(|k| &element.properties[k]).collect();
                if !others.is_empty() {
                    let names = listed(others.iter().map(|property| property.name.as_bytes()));
                    dropped.add_on_faces(format!("{} ({names}) of its faces", plural(others.len())));
                }
            }
            name => {
                let items = counted(usize::try_from(element.count).unwrap_or(usize::MAX), "item");
                dropped.add(format!("{items} of {}", listed([name.as_bytes()])));
            }
        }
    }
    if header.has_texture {
        dropped.add("its texture (TextureFile)");
    }
}

/// `59 of 62 properties (nx, ny, nz, f_dc_0 and 55 more)`, of those that are chosen.
fn of_element(element: &Element, is_chosen: impl Fn(&Property) -> bool) -> Option<String> {
    let chosen: Vec<&Property> = element.properties.iter().filter(|property| is_chosen(property)).collect();
    let names = listed(chosen.iter().map(|property| property.name.as_bytes()));
    let all = element.properties.len();
    (!chosen.is_empty()).then(|| format!("{} of {all} properties ({names})", chosen.len()))
}

fn plural(count: usize) -> String {
    if count == 1 { "1 property".to_owned() } else { format!("{count} properties") }
}
