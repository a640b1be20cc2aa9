//! As much of Python's syntax as the headers of `.npy` files need.

use serde_json::Value;

/// The header of an array as it stands.
pub(super) struct Header {
    pub(super) kind: Kind,
    pub(super) fortran: bool,
    pub(super) shape: Vec<u64>,
}

/// The type of an array's values.
pub(super) enum Kind {
    /// Such as `<f4`.
    Plain(String),
    /// Records, with the names of their fields.
    Records(Vec<String>),
}

/// The dictionary that a `.npy` file begins with.
pub(super) fn header(text: &[u8]) -> Option<Header> {
    let Ok(Value::Object(mut found)) = serde_json::from_str(&as_json(&String::from_utf8_lossy(text))) else {
        return None;
    };
    let kind = match found.remove("descr")? {
        Value::String(kind) => Kind::Plain(kind),
        // `[('x', '<f4'), …]`.
        Value::Array(fields) => {
            Kind::Records(fields.iter().filter_map(|field| Some(field.get(0)?.as_str()?.to_owned())).collect())
        }
        _ => return None,
    };
    let fortran = found.remove("fortran_order")?.as_bool()?;
    let shape = serde_json::from_value(found.remove("shape")?).ok()?;
    found.is_empty().then_some(Header { kind, fortran, shape })
}

/// The JSON of a literal of Python, which has other quotes, brackets and words.
fn as_json(text: &str) -> String {
    let (mut json, mut quote) = (String::new(), None);
    for c in text.chars() {
        match (quote, c) {
            (Some(opening), c) if c == opening => {
                json.push('"');
                quote = None;
            }
            (Some(_), '"' | '\\') => json.extend(['\\', c]),
            (None, '\'' | '"') => {
                json.push('"');
                quote = Some(c);
            }
            (None, '(') => json.push('['),
            (None, ')' | ']' | '}') => {
                let inside = json.trim_end();
                json.truncate(inside.strip_suffix(',').unwrap_or(inside).len());
                json.push(if c == ')' { ']' } else { c });
            }
            (None, 'T' | 'F') => json.push(c.to_ascii_lowercase()),
            // Python 2 wrote `3L`.
            (None, 'L') => {}
            (_, c) => json.push(c),
        }
    }
    json
}
