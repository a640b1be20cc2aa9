//! Polygon File Format: ASCII, binary little-endian and binary big-endian.

mod header;
mod unread;
mod values;

use cager_geometry::mesh::Model;

use super::parsed::Parsed;
use crate::colors::Colors;
use crate::error::Fault;
use crate::faces::{Contents, no_such_vertex};
use header::{Element, Encoding, Header, Kind};
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
    let mut face = Vec::new();
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => read_points(element, contents, &mut values, &mut parsed.model)?,
            "face" if faces => each_list(element, &mut values, |k, list| {
                face.clear();
                for &corner in list {
                    face.push(vertex(corner, points, || format!("face {k}"))?);
                }
                if face.len() >= 3 {
                    parsed.model.faces.push(&face);
                } else {
                    parsed.left_out += 1;
                }
                Ok(())
            })?,
            "tristrips" if faces => {
                each_list(element, &mut values, |k, strip| add_strip(strip, points, k, &mut parsed.model))?;
            }
            _ => skip(element, &mut values)?,
        }
    }
    if faces {
        unread::tell(header, &mut parsed);
    }
    Ok(parsed)
}

fn read_points<V: Values>(
    element: &Element,
    contents: Contents,
    values: &mut V,
    model: &mut Model,
) -> Result<(), Fault> {
    let columns = element.coordinates()?;
    let said = element.colors().filter(|_| contents == Contents::PointsAndFaces);
    let color_columns = said.map(|(columns, _)| columns);
    let normal_columns = element.normals().filter(|_| contents == Contents::PointsAndFaces);
    let mut colors = Colors::default();
    // Three scalars take at least three bytes.
    let most = (values.remaining() / 3) as u64;
    model.points.reserve_exact(element.count.min(most) as usize);
    if normal_columns.is_some() {
        model.normals.reserve_exact(element.count.min(most) as usize);
    }
    let role = |column| {
        let axis = |columns: [usize; 3]| columns.iter().position(|&c| c == column);
        axis(columns)
            .map(Role::Coordinate)
            .or(normal_columns.and_then(axis).map(Role::Normal))
            .or(color_columns.and_then(|columns| channel_of(columns, column)))
    };
    let roles: Vec<_> = element.properties.iter().enumerate().map(|(k, property)| (property.kind, role(k))).collect();
    for k in 0..element.count {
        let (mut point, mut color, mut normal) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for &(kind, ref role) in &roles {
            let value = match kind {
                Kind::Scalar(scalar) => values.next(scalar),
                Kind::List { count, item } => skip_list(values, count, item).map(|()| 0.0),
            };
            let value = value.map_err(|fault| fault.inside(element, k))?;
            match *role {
                Some(Role::Coordinate(axis)) => point[axis] = value,
                Some(Role::Normal(axis)) => normal[axis] = value,
                Some(Role::Channel(channel, most)) => color[channel] = (value / most) as f32,
                None => {}
            }
        }
        if !point.iter().all(|x| x.is_finite()) {
            return Err(Fault::invalid(format!(
                "vertex {k} has a coordinate that is NaN or infinite; repair or remove it"
            )));
        }
        model.points.push(point);
        if color_columns.is_some() {
            colors.push(color);
        }
        if normal_columns.is_some() {
            model.normals.push(normal);
        }
    }
    if let Some((_, scale)) = said {
        model.colors = colors.finish(model.points.len(), scale);
    }
    Ok(())
}

/// What a column of the vertices holds, of three each.
enum Role {
    Coordinate(usize),
    Normal(usize),
    /// And the value of full light.
    Channel(usize, f64),
}

fn channel_of(columns: [(usize, f64); 3], column: usize) -> Option<Role> {
    let channel = columns.iter().position(|&(c, _)| c == column)?;
    Some(Role::Channel(channel, columns[channel].1))
}

/// Calls `each` with the number of every item of an element and its list of vertices.
fn each_list<V: Values>(
    element: &Element,
    values: &mut V,
    mut each: impl FnMut(u64, &[f64]) -> Result<(), Fault>,
) -> Result<(), Fault> {
    if element.count == 0 {
        return Ok(());
    }
    let corners = element.corners()?;
    let mut list = Vec::new();
    for k in 0..element.count {
        for (column, property) in element.properties.iter().enumerate() {
            match property.kind {
                Kind::List { count, item } if column == corners => {
                    list.clear();
                    let length = values.length(count).map_err(|fault| fault.inside(element, k))?;
                    for _ in 0..length {
                        list.push(values.next(item).map_err(|fault| fault.inside(element, k))?);
                    }
                }
                kind => skip_value(values, kind).map_err(|fault| fault.inside(element, k))?,
            }
        }
        each(k, &list)?;
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

fn skip_list<V: Values>(values: &mut V, count: header::Scalar, item: header::Scalar) -> Result<(), values::Failure> {
    for _ in 0..values.length(count)? {
        values.next(item)?;
    }
    Ok(())
}
