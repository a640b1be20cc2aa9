//! NumPy arrays: a header that is a Python dictionary, then the array.

use super::layout::{LONGEST_HEADER, Layout, Order};
use super::python::{self, Header, Kind};
use super::widen::Scalar;
use crate::error::Fault;
use crate::text::quoted;

const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// An array in the Python that messages give, where `path` stands for the file.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    /// Its name in an archive.
    pub(super) name: Option<&'a str>,
}

impl Place<'_> {
    /// The expression that loads the array; `options` follow the path.
    fn load(self, options: &str) -> String {
        let file = format!("numpy.load(path{options})");
        self.name.map_or_else(|| file.clone(), |name| format!("{file}[{name:?}]"))
    }
}

/// The statement that saves what is made of an array.
fn save(made: &str) -> String {
    format!("convert it in Python with numpy.save(\"converted.npy\", {made})")
}

pub(super) fn layout(head: &[u8], expected_points: u64, place: Place<'_>) -> Result<Layout, Fault> {
    let (header, start) = parse(head)?;
    let scalar = scalar(&header, expected_points, place)?;
    let (frames, points, order) = axes(&header.shape, expected_points, place)?;
    let mut layout = Layout::new(points, frames, start, scalar);
    layout.order = order;
    let rows = match order {
        Order::Axes => 3,
        _ if header.shape.last() == Some(&expected_points.saturating_mul(3)) => 1,
        Order::Points | Order::Homogeneous => points,
    };
    layout.fortran = header.fortran.then_some(rows);
    Ok(layout)
}

/// The header, and where the array begins.
fn parse(head: &[u8]) -> Result<(Header, u64), Fault> {
    let (start, length) = header_bounds(head)?;
    let text = head.get(start..start + length).ok_or_else(truncated)?;
    let header = python::header(text).ok_or_else(|| {
        Fault::damaged(format!(
            "has the header {}, which is not understood; save the array again with numpy.save",
            quoted(text)
        ))
    })?;
    Ok((header, (start + length) as u64))
}

/// Where the text of the header begins, and its length.
pub(super) fn header_bounds(head: &[u8]) -> Result<(usize, usize), Fault> {
    let Some(rest) = head.strip_prefix(MAGIC) else {
        return Err(Fault::damaged("does not begin as a .npy file does; save the array again with numpy.save"));
    };
    let (start, length) = match *rest {
        [1, _, a, b, ..] => (10, u16::from_le_bytes([a, b]).into()),
        [2 | 3, _, a, b, c, d, ..] => (12, u32::from_le_bytes([a, b, c, d]) as usize),
        [1..=3, ..] | [] => return Err(truncated()),
        [version, ..] => {
            return Err(Fault::unsupported(format!(
                "is of .npy version {version}; save the array again with numpy.save"
            )));
        }
    };
    if length > LONGEST_HEADER - start {
        return Err(Fault::damaged(format!(
            "has a header of {length} bytes, longer than an array of floats has; save the array again with numpy.save"
        )));
    }
    Ok((start, length))
}

fn truncated() -> Fault {
    Fault::damaged("ends within its header; copy or save the file again")
}

fn scalar(header: &Header, points: u64, place: Place<'_>) -> Result<Scalar, Fault> {
    let advice = match &header.kind {
        Kind::Plain(kind) => match kind.as_str() {
            "<f4" => return Ok(Scalar::F32Little),
            ">f4" => return Ok(Scalar::F32Big),
            "<f8" => return Ok(Scalar::F64Little),
            ">f8" => return Ok(Scalar::F64Big),
            "|O" if header.shape.is_empty() => {
                let load = place.load(", allow_pickle=True");
                format!(
                    "holds one Python object, not an array; save the frames in it, where {load}.item() is a dictionary \
                     with numpy.save(\"converted.npy\", {load}.item()[NAME])"
                )
            }
            "|O" => {
                let load = place.load(", allow_pickle=True");
                let made = format!("numpy.array([frame for frame in {load} if len(frame) == {points}], \"<f4\")");
                format!(
                    "has Python objects, which may be frames of any number of points; keep those of {points}: {}",
                    save(&made)
                )
            }
            kind => {
                let save = save(&format!("{}.astype(\"<f4\")", place.load("")));
                format!("has values of type {}, not 32- or 64-bit floats; {save}", quoted(kind.as_bytes()))
            }
        },
        Kind::Records(fields) => {
            let load = place.load("");
            let made = if ["x", "y", "z"].iter().all(|axis| fields.iter().any(|field| field == axis)) {
                format!("numpy.stack([{load}[k] for k in \"xyz\"], -1).astype(\"<f4\")")
            } else {
                format!("{load}[{}]", fields.first().map_or("NAME".to_owned(), |field| quoted(field.as_bytes())))
            };
            let names: Vec<String> = fields.iter().take(6).map(|field| quoted(field.as_bytes())).collect();
            format!("has records ({}), not plain floats; {}", names.join(", "), save(&made))
        }
    };
    Err(Fault::unsupported(advice))
}

/// Frames, points, and how the coordinates of a frame follow each other.
fn axes(shape: &[u64], expected: u64, place: Place<'_>) -> Result<(u64, u64, Order), Fault> {
    let flat = expected.saturating_mul(3);
    let arranged = |what: &str, method: String| {
        let save = save(&format!("{}.{method}", place.load("")));
        Err(Fault::unsupported(format!("has the shape {}, {what}; {save}", listed(shape))))
    };
    // A batch of one capture.
    let inner = match shape {
        [1, inner @ ..] if shape.len() > 3 => inner,
        _ => shape,
    };
    Ok(match *inner {
        [points, 3] | [1, points, 3] if points == expected => (1, points, Order::Points),
        [3, points] if points == expected => (1, points, Order::Axes),
        // x y z x y z … in each row, as tools for faces save them.
        [frames, values] if values == flat => (frames, expected, Order::Points),
        [values] if values == flat => (1, expected, Order::Points),
        [values, _] if values == flat => return arranged("a column for each frame", "T".to_owned()),
        [points, frames, 3] if points == expected && frames != expected => {
            return arranged("points before frames", "transpose(1, 0, 2)".to_owned());
        }
        [points, 3, frames] if points == expected && frames != expected && frames != 3 => {
            return arranged("points before frames", "transpose(2, 0, 1)".to_owned());
        }
        [frames, points, 3] => (frames, points, Order::Points),
        [points, 3] => (1, points, Order::Points),
        [frames, points, 4] if points == expected => (frames, points, Order::Homogeneous),
        [frames, 3, points] => (frames, points, Order::Axes),
        [3, points] => (1, points, Order::Axes),
        [frames, points, 4] => (frames, points, Order::Homogeneous),
        [.., points, 3] if points == expected => {
            return arranged("frames along several axes", format!("reshape(-1, {points}, 3)"));
        }
        [frames, values] if values > 4 && values % 3 == 0 => (frames, values / 3, Order::Points),
        _ => {
            return Err(Fault::unsupported(format!(
                "has the shape {}, not (frames, points, 3) or (frames, 3 × points) with {expected} points; bring its \
                 axes into this order with numpy.transpose",
                listed(shape)
            )));
        }
    })
}

/// A shape as Python shows it.
fn listed(shape: &[u64]) -> String {
    let axes: Vec<String> = shape.iter().take(8).map(u64::to_string).collect();
    format!("({}{})", axes.join(", "), if shape.len() == 1 { "," } else { "" })
}

/// The type and shape of an array, in words.
pub(super) fn described(head: &[u8]) -> String {
    match parse(head) {
        Ok((Header { kind: Kind::Plain(kind), shape, .. }, _)) => format!("{kind} {}", listed(&shape)),
        Ok((Header { shape, .. }, _)) => format!("records {}", listed(&shape)),
        Err(_) => "not an array".to_owned(),
    }
}

/// How many axes an array has.
pub(super) fn axes_count(head: &[u8]) -> usize {
    parse(head).map_or(0, |(header, _)| header.shape.len())
}

/// The only number of an array; of whole ones, those of 16 bits.
pub(super) fn single_number(file: &[u8]) -> Option<f64> {
    let (header, start) = parse(file).ok()?;
    let Kind::Plain(kind) = &header.kind else { return None };
    let only = header.shape.iter().all(|&length| length == 1);
    let mut bytes = file.get(usize::try_from(start).ok()?..).filter(|_| only)?.to_vec();
    if kind.starts_with('>') {
        bytes.reverse();
    }
    Some(match (kind.get(1..)?, bytes.as_slice()) {
        ("f4", &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
        ("f8", &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        (kind, _) if kind.starts_with(['i', 'u']) && bytes.iter().skip(2).all(|&byte| byte == 0) => {
            f64::from(*bytes.first()?) + 256.0 * f64::from(bytes.get(1).copied().unwrap_or(0))
        }
        _ => return None,
    })
}

/// A header as `numpy.save` writes it.
pub(super) fn header(points: usize, frames: usize, bytes: usize) -> Vec<u8> {
    let mut text = format!("{{'descr': '<f{bytes}', 'fortran_order': False, 'shape': ({frames}, {points}, 3), }}");
    // The array begins at a multiple of 64 bytes.
    let length = (MAGIC.len() + 4 + text.len() + 1).next_multiple_of(64) - MAGIC.len() - 4;
    text.extend(std::iter::repeat_n(' ', length - 1 - text.len()));
    text.push('\n');
    let mut header = MAGIC.to_vec();
    header.extend([1, 0]);
    header.extend((length as u16).to_le_bytes());
    header.extend(text.bytes());
    header
}
