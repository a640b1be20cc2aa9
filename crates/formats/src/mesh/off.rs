//! Object File Format in ASCII, one vertex a line.

use cager_geometry::mesh::Model;

use super::parsed::Parsed;
use crate::dropped::Dropped;
use crate::error::Fault;
use crate::faces::{Contents, check_face};
use crate::text::{Lines, damaged, integer, point, quoted, words};

pub(super) fn read(bytes: &[u8], contents: Contents) -> Result<Parsed, Fault> {
    let mut lines = ContentLines(Lines::new(bytes));
    let (points, faces, mut dropped) = counts(&mut lines)?;
    let (mut model, mut left_out) = (Model::default(), 0);
    // A vertex takes at least six bytes: three digits and three separators.
    model.points.reserve_exact(points.min(lines.0.rest().len() / 6 + 1));
    for k in 0..points {
        let Some(line) = lines.next() else {
            return Err(truncated("vertices", k, points));
        };
        let number = lines.0.number();
        let mut words = words(line);
        let point = point(&mut words, || format!("line {number}"))?;
        model.points.push(point);
        if words.next().is_some() && dropped.is_empty() {
            dropped.add("numbers behind the positions of vertices");
        }
    }
    if contents == Contents::Points {
        return Ok(Parsed { left_out, ..model.into() });
    }
    let mut face = Vec::new();
    for k in 0..faces {
        let Some(line) = lines.next() else {
            return Err(truncated("faces", k, faces));
        };
        let number = lines.0.number();
        if read_face(line, &mut lines, &mut face)? {
            dropped.add_on_faces("colours of faces");
        }
        check_face(&face, points, || format!("line {number}"))?;
        if face.len() >= 3 {
            model.faces.push(&face);
        } else {
            left_out += 1;
        }
    }
    Ok(Parsed { left_out, dropped, ..model.into() })
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

/// Numbers of vertices and faces, and what the keyword promises beside positions.
fn counts(lines: &mut ContentLines<'_>) -> Result<(usize, usize, Dropped), Fault> {
    let mut dropped = Dropped::default();
    let mut line = lines.next().unwrap_or_default();
    let keyword = words(line).next().unwrap_or_default();
    // Some files have no space between the keyword and the numbers.
    let end = keyword.windows(3).position(|w| w == b"OFF").map(|at| at + 3);
    if let Some(end) = end.filter(|&end| keyword[end..].iter().all(u8::is_ascii_digit)) {
        let keyword = &keyword[..end];
        if keyword[..end - 3].iter().any(|b| !b"STCN".contains(b)) {
            return Err(Fault::unsupported(format!(
                "line {}: {} has points that are not in three dimensions; convert it to OFF or OBJ",
                lines.0.number(),
                quoted(keyword)
            )));
        }
        for (letter, phrase) in
            [(b'S', "texture coordinates (STOFF)"), (b'C', "vertex colours (COFF)"), (b'N', "normals (NOFF)")]
        {
            if keyword[..end - 3].contains(&letter) {
                dropped.add(phrase);
            }
        }
        line = line[end..].trim_ascii();
        if line.eq_ignore_ascii_case(b"BINARY") {
            return Err(Fault::unsupported("is a binary OFF file; convert it to ASCII OFF or to PLY"));
        }
        if line.is_empty() {
            line = lines.next().unwrap_or_default();
        }
    }
    let number = lines.0.number().max(1);
    let mut found = words(line).map(integer);
    let points = found.next().flatten();
    let faces = found.next().or_else(|| words(lines.next()?).map(integer).next()).flatten();
    points.zip(faces).map(|(points, faces)| (points, faces, dropped)).ok_or_else(|| {
        let what = "the numbers of vertices and faces are missing, so this is not an OFF file; export the mesh again";
        damaged(number, what)
    })
}

/// A number of corners and as many vertices; gives whether a colour follows.
fn read_face(line: &[u8], lines: &mut ContentLines<'_>, face: &mut Vec<u32>) -> Result<bool, Fault> {
    let start = lines.0.number();
    let unreadable = |word: &[u8], number: usize| {
        let word = quoted(word);
        damaged(number, &format!("{word} is not a whole number that a face can have; export the mesh again"))
    };
    let first = words(line).next().unwrap_or_default();
    let corners: usize = integer(first).ok_or_else(|| unreadable(first, start))?;
    face.clear();
    let mut line = &line[first.len()..];
    loop {
        let mut words = words(line);
        for word in words.by_ref().take(corners - face.len()) {
            face.push(integer(word).ok_or_else(|| unreadable(word, lines.0.number()))?);
        }
        if face.len() == corners {
            return Ok(words.next().is_some());
        }
        line = lines.next().ok_or_else(|| {
            let has = face.len();
            let what = format!("the face has {has} of the {corners} corners that it promises; export the mesh again");
            damaged(start, &what)
        })?;
    }
}

fn truncated(what: &str, found: usize, promised: usize) -> Fault {
    Fault::damaged(format!("ends after {found} of {promised} {what}; copy or export the file again"))
}
