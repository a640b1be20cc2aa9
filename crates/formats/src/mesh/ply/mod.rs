//! Polygon File Format: ASCII, binary little-endian and binary big-endian.

mod header;
mod surface;
mod unread;
mod values;

use cager_geometry::mesh::Model;

use super::parsed::Parsed;
use crate::colors::Colors;
use crate::error::Fault;
use crate::faces::{Contents, no_such_vertex};
use header::{Element, Encoding, Header, Kind, Property};
use surface::Coordinates;
use values::{Ascii, Binary, Values};

pub(super) fn read(bytes: &[u8], contents: Contents) -> Result<Parsed, Fault> {
    let header = header::parse(bytes)?;
    match header.encoding {
        Encoding::Ascii => read_elements(&header, contents, Ascii::new(header.body.clone())),
        Encoding::LittleEndian => read_elements(&header, contents, Binary::<false>::new(header.body.rest())),
        Encoding::BigEndian => read_elements(&header, contents, Binary::<true>::new(header.body.rest())),
    }
}

fn read_elements<V: Values>(header: &Header<'_>, contents: Contents, mut values: V) -> Result<Parsed, Fault> {
    let mut parsed = Parsed::from(Model::default());
    let points = header.vertices()?;
    let faces = contents == Contents::PointsAndFaces;
    let (mut face, mut coordinates) = (Vec::new(), Coordinates::default());
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => {
                coordinates.vertices = read_points(element, contents, &mut values, &mut parsed.model)?;
            }
            "face" if faces => each_list(element, &mut values, |k, List { vertices: list, texture, picture }| {
                face.clear();
                for &corner in list {
                    face.push(vertex(corner, points, || format!("face {k}"))?);
                }
                if face.len() >= 3 {
                    parsed.model.faces.push(&face);
                    coordinates.face(face.len(), texture, picture);
                } else {
                    parsed.left_out += 1;
                }
                Ok(())
            })?,
            "tristrips" if faces => {
                each_list(element, &mut values, |k, strip| add_strip(strip.vertices, points, k, &mut parsed.model))?;
            }
            _ => skip(element, &mut values)?,
        }
    }
    if faces {
        let is_dressed = coordinates.finish(&mut parsed.model, &header.textures);
        unread::tell(header, &mut parsed, is_dressed);
    }
    Ok(parsed)
}

/// What is read of a vertex, where all three of a kind are there.
const READ: [&str; 11] = ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "s", "t"];

fn read_points<V: Values>(
    element: &Element,
    contents: Contents,
    values: &mut V,
    model: &mut Model,
) -> Result<Vec<[f32; 2]>, Fault> {
    if let Some(axis) = READ[..3].iter().find(|axis| element.scalar(axis).is_none()) {
        return Err(Fault::unsupported(format!("has vertices without {axis}; export the mesh with x, y and z")));
    }
    let all = contents == Contents::PointsAndFaces;
    let has_normals = all && READ[3..6].iter().all(|name| element.scalar(name).is_some());
    let full_light = element.full_light().filter(|_| all);
    let has_coordinates =
        all && READ[9..].iter().all(|name| element.properties.iter().any(|found| surface::plain(&found.name) == *name));
    let (mut colors, mut coordinates) = (Colors::default(), Vec::new());
    // Three scalars take at least three bytes.
    let most = (values.remaining() / 3) as u64;
    model.points.reserve_exact(element.count.min(most) as usize);
    if has_normals {
        model.normals.reserve_exact(element.count.min(most) as usize);
    }
    // Of scalars that have one name the first counts.
    let mut is_free = [true; READ.len()];
    let mut place = |property: &Property| {
        let place = READ.iter().position(|name| *name == surface::plain(&property.name))?;
        (matches!(property.kind, Kind::Scalar(_)) && std::mem::take(&mut is_free[place])).then_some(place)
    };
    let columns: Vec<_> = element.properties.iter().map(|property| (property.kind, place(property))).collect();
    for k in 0..element.count {
        let mut found = [0.0; READ.len()];
        for &(kind, place) in &columns {
            let value = match kind {
                Kind::Scalar(scalar) => values.next(scalar),
                Kind::List { count, item } => skip_list(values, count, item).map(|()| 0.0),
            };
            let value = value.map_err(|fault| fault.inside(element, k))?;
            if let (Kind::Scalar(_), Some(place)) = (kind, place) {
                found[place] = value;
            }
        }
        let [x, y, z, nx, ny, nz, red, green, blue, s, t] = found;
        if !(x.is_finite() && y.is_finite() && z.is_finite()) {
            return Err(Fault::invalid(format!(
                "vertex {k} has a coordinate that is NaN or infinite; repair or remove it"
            )));
        }
        model.points.push([x, y, z]);
        if has_normals {
            model.normals.push([nx, ny, nz]);
        }
        if has_coordinates {
            coordinates.push([s as f32, t as f32]);
        }
        if let Some(([full_red, full_green, full_blue], _)) = full_light {
            colors.push([red / full_red, green / full_green, blue / full_blue].map(|x| x as f32));
        }
    }
    if let Some((_, scale)) = full_light {
        model.colors = colors.finish(model.points.len(), scale);
    }
    Ok(coordinates)
}

/// A face, or a strip of them.
struct List<'a> {
    vertices: &'a [f64],
    /// Two numbers for each corner, where it has them.
    texture: &'a [f64],
    picture: f64,
}

/// Calls `each` with the number of every item of an element and its list of vertices.
fn each_list<V: Values>(
    element: &Element,
    values: &mut V,
    mut each: impl FnMut(u64, List<'_>) -> Result<(), Fault>,
) -> Result<(), Fault> {
    if element.count == 0 {
        return Ok(());
    }
    let corners = element.corners()?;
    let (mut list, mut texture) = (Vec::new(), Vec::new());
    for k in 0..element.count {
        let mut picture = 0.0;
        for (column, property) in element.properties.iter().enumerate() {
            let read = match (property.kind, property.name.as_str()) {
                (Kind::List { count, item }, _) if column == corners => read_list(values, count, item, &mut list),
                (Kind::List { count, item }, "texcoord") => read_list(values, count, item, &mut texture),
                (Kind::Scalar(scalar), "texnumber") => values.next(scalar).map(|number| picture = number),
                (kind, _) => skip_value(values, kind),
            };
            read.map_err(|fault| fault.inside(element, k))?;
        }
        each(k, List { vertices: &list, texture: &texture, picture })?;
    }
    Ok(())
}

/// Unfolds a strip of triangles, in which −1 begins anew.
fn add_strip(strip: &[f64], points: u64, k: u64, model: &mut Model) -> Result<(), Fault> {
    for part in strip.split(|&index| index == -1.0) {
        let mut last = [0; 2];
        for (i, &corner) in part.iter().enumerate() {
            let corner = vertex(corner, points, || format!("strip {k}"))?;
            let [a, b] = last;
            last = [b, corner];
            // Triangles that repeat a vertex only lead the strip elsewhere.
            if i >= 2 && a != b && b != corner && corner != a {
                // Every other triangle of a strip is turned around.
                model.faces.push(&if i % 2 == 0 { [a, b, corner] } else { [b, a, corner] });
            }
        }
    }
    Ok(())
}

fn vertex(index: f64, points: u64, place: impl Fn() -> String) -> Result<u32, Fault> {
    let exists = index >= 0.0 && index < points as f64 && index.fract() == 0.0;
    if exists { Ok(index as u32) } else { Err(no_such_vertex(&place(), index as i64, points as usize)) }
}

fn skip<V: Values>(element: &Element, values: &mut V) -> Result<(), Fault> {
    // Nothing is stored for an element without properties, whatever its count.
    if element.properties.is_empty() {
        return Ok(());
    }
    for k in 0..element.count {
        for property in &element.properties {
            skip_value(values, property.kind).map_err(|fault| fault.inside(element, k))?;
        }
    }
    Ok(())
}

fn skip_value<V: Values>(values: &mut V, kind: Kind) -> Result<(), values::Failure> {
    match kind {
        Kind::Scalar(scalar) => values.next(scalar).map(drop),
        Kind::List { count, item } => skip_list(values, count, item),
    }
}

fn read_list<V: Values>(
    values: &mut V,
    count: header::Scalar,
    item: header::Scalar,
    list: &mut Vec<f64>,
) -> Result<(), values::Failure> {
    list.clear();
    for _ in 0..values.length(count)? {
        list.push(values.next(item)?);
    }
    Ok(())
}

fn skip_list<V: Values>(values: &mut V, count: header::Scalar, item: header::Scalar) -> Result<(), values::Failure> {
    for _ in 0..values.length(count)? {
        values.next(item)?;
    }
    Ok(())
}
