//! Object File Format in ASCII, one vertex or face a line; colours, normals and texture coordinates are skipped.

use cager_core::mesh::Model;

use super::{Contents, check_face};
use crate::error::Fault;
use crate::text::{Lines, integer, point, quoted, words};

pub(super) fn read(bytes: &[u8], contents: Contents) -> Result<Model, Fault> {
    let mut lines = ContentLines(Lines::new(bytes));
    let (points, faces) = counts(&mut lines)?;
    let mut model = Model::default();
    // A vertex takes at least six bytes: three digits and three separators.
    model.points.reserve_exact(points.min(lines.0.rest().len() / 6 + 1));
    for k in 0..points {
        let Some(line) = lines.next() else {
            return Err(truncated("vertices", k, points));
        };
        let number = lines.0.number();
        let point = point(&mut words(line), || format!("line {number}"))?;
        model.points.push(point);
    }
    if contents == Contents::Points {
        return Ok(model);
    }
    let mut face = Vec::new();
    for k in 0..faces {
        let Some(line) = lines.next() else {
            return Err(truncated("faces", k, faces));
        };
        let number = lines.0.number();
        read_face(line, number, &mut face)?;
        check_face(&face, points, || format!("line {number}"))?;
        model.faces.push(&face);
    }
    Ok(model)
}

/// The lines that say something, without comments.
struct ContentLines<'a>(Lines<'a>);

impl<'a> Iterator for ContentLines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        self.0
            .by_ref()
            .map(|line| line.split(|&b| b == b'#').next().unwrap_or(line).trim_ascii())
            .find(|line| !line.is_empty())
    }
}

/// Numbers of vertices and faces, from the line of the keyword or the one after it.
fn counts(lines: &mut ContentLines<'_>) -> Result<(usize, usize), Fault> {
    let mut line = lines.next().unwrap_or_default();
    let keyword = words(line).next().unwrap_or_default();
    if let Some(prefix) = keyword.strip_suffix(b"OFF") {
        if prefix.iter().any(|b| !b"STCN".contains(b)) {
            return Err(Fault::unsupported(format!(
                "line {}: {} has points that are not in three dimensions; convert it to OFF or OBJ",
                lines.0.number(),
                quoted(keyword)
            )));
        }
        line = line[keyword.len()..].trim_ascii();
        if line.eq_ignore_ascii_case(b"BINARY") {
            return Err(Fault::unsupported("is a binary OFF file; convert it to ASCII OFF or to PLY"));
        }
        if line.is_empty() {
            line = lines.next().unwrap_or_default();
        }
    }
    let mut numbers = words(line).map(integer);
    match (numbers.next().flatten(), numbers.next().flatten()) {
        (Some(points), Some(faces)) => Ok((points, faces)),
        _ => Err(Fault::damaged(format!(
            "line {}: the numbers of vertices and faces are missing, so this is not an OFF file; export the mesh again",
            lines.0.number().max(1)
        ))),
    }
}

fn read_face(line: &[u8], number: usize, face: &mut Vec<u32>) -> Result<(), Fault> {
    let mut words = words(line);
    let unreadable = |word: &[u8]| {
        Fault::damaged(format!(
            "line {number}: {} is not a whole number that a face can have; export the mesh again",
            quoted(word)
        ))
    };
    let first = words.next().unwrap_or_default();
    let corners: usize = integer(first).ok_or_else(|| unreadable(first))?;
    face.clear();
    for word in words.by_ref().take(corners) {
        face.push(integer(word).ok_or_else(|| unreadable(word))?);
    }
    if face.len() < corners {
        return Err(Fault::damaged(format!(
            "line {number}: the face has {} of the {corners} corners that it promises; export the mesh again",
            face.len()
        )));
    }
    Ok(())
}

fn truncated(what: &str, found: usize, promised: usize) -> Fault {
    Fault::damaged(format!("ends after {found} of {promised} {what}; copy or export the file again"))
}
