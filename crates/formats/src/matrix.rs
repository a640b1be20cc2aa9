//! Sparse matrices in the Matrix Market format (Boisvert, Pozo and Remington 1996).

use crate::error::{Error, Fault};
use crate::signature::Signature;
use crate::text::{Lines, damaged, integer, number, quoted, words};
use cager_geometry::linalg::SparseMatrix;
use std::path::Path;

/// Bytes of the shortest entry: two numbers of one digit, a space and the end of the line.
const SHORTEST_ENTRY: usize = 4;

/// Reads a sparse matrix: `coordinate`, `real`, `integer` or `pattern`, `general` or `symmetric`.
///
/// # Errors
/// See [`Error`]; its message names the line.
pub fn read_matrix(path: impl AsRef<Path>) -> Result<SparseMatrix, Error> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|cause| Error::read(path, cause))?;
    read_matrix_bytes(path, &bytes)
}

/// As [`read_matrix`], of bytes; `name` stands for the file in messages.
///
/// # Errors
/// As [`read_matrix`].
pub fn read_matrix_bytes(name: &Path, bytes: &[u8]) -> Result<SparseMatrix, Error> {
    read(bytes).map_err(|fault| Signature::other_than("mtx", bytes).map_or(fault, Fault::damaged).at(name))
}

/// What the first line says.
#[derive(Clone, Copy)]
struct Kind {
    /// Values are written out; otherwise they are ones.
    has_values: bool,
    /// Only the lower triangle is written.
    symmetric: bool,
}

/// An entry and the line it came from.
struct Entry {
    row: u32,
    column: u32,
    value: f64,
    line: usize,
}

fn read(bytes: &[u8]) -> Result<SparseMatrix, Fault> {
    let mut lines = Lines::new(bytes);
    let kind = kind(lines.next().unwrap_or_default())?;
    let (rows, columns, promised) = sizes(&mut lines, kind)?;
    let room = lines.rest().len() / SHORTEST_ENTRY + 1;
    if promised > room {
        return Err(damaged(
            lines.number(),
            &format!("{promised} entries are promised, more than the file can hold; copy or export it again"),
        ));
    }
    let mut entries = Vec::with_capacity(promised);
    while let Some(line) = lines.next() {
        if line.is_empty() || line.starts_with(b"%") {
            continue;
        }
        if entries.len() == promised {
            let what = format!("there are more than the {promised} entries that are promised; export the matrix again");
            return Err(damaged(lines.number(), &what));
        }
        entries.push(entry(line, lines.number(), kind, rows, columns)?);
    }
    if entries.len() < promised {
        return Err(Fault::damaged(format!(
            "ends after {} of {promised} entries; copy or export the file again",
            entries.len()
        )));
    }
    refuse_repetition(&mut entries)?;
    let mirrored = |e: &Entry| (kind.symmetric && e.row != e.column).then_some((e.column, e.row, e.value));
    let all = entries.iter().flat_map(|e| [Some((e.row, e.column, e.value)), mirrored(e)]).flatten().collect();
    SparseMatrix::new(rows as usize, columns as usize, all)
        .ok_or_else(|| Fault::invalid("has an entry beyond 1e100, which cannot be squared; scale the matrix down"))
}

fn kind(line: &[u8]) -> Result<Kind, Fault> {
    let wrong = |what: &str| {
        Fault::unsupported(format!(
            "line 1: {what}; give a file that begins with \"%%MatrixMarket matrix coordinate real general\""
        ))
    };
    let mut words = words(line).map(<[u8]>::to_ascii_lowercase);
    let mut next = || words.next().unwrap_or_default();
    if next() != b"%%matrixmarket" || next() != b"matrix" {
        return Err(wrong("this is not a matrix in the Matrix Market format"));
    }
    let (layout, field, symmetry) = (next(), next(), next());
    if layout != b"coordinate" {
        return Err(wrong(&format!("the layout {} is not read here", quoted(&layout))));
    }
    let has_values = match field.as_slice() {
        b"real" | b"integer" => true,
        b"pattern" => false,
        _ => return Err(wrong(&format!("entries of the kind {} are not read here", quoted(&field)))),
    };
    let symmetric = match symmetry.as_slice() {
        b"general" => false,
        b"symmetric" => true,
        _ => return Err(wrong(&format!("the symmetry {} is not read here", quoted(&symmetry)))),
    };
    Ok(Kind { has_values, symmetric })
}

/// Rows, columns and entries.
fn sizes(lines: &mut Lines<'_>, kind: Kind) -> Result<(u32, u32, usize), Fault> {
    let line = lines.by_ref().find(|line| !line.is_empty() && !line.starts_with(b"%")).unwrap_or_default();
    let place = lines.number();
    let mut numbers = words(line);
    let mut next = || numbers.next().and_then(integer::<u64>);
    let (Some(rows), Some(columns), Some(entries)) = (next(), next(), next()) else {
        return Err(damaged(place, "the numbers of rows, columns and entries are missing; export the matrix again"));
    };
    if let Some(word) = numbers.next() {
        let what = "follows the numbers of rows, columns and entries; export the matrix again";
        return Err(damaged(place, &format!("{} {what}", quoted(word))));
    }
    let (Ok(r), Ok(c)) = (u32::try_from(rows), u32::try_from(columns)) else {
        return Err(Fault::unsupported(format!(
            "line {place}: {rows} × {columns} is larger than any matrix read here; leave out what does not belong to the cage"
        )));
    };
    if entries > u64::from(r) * u64::from(c) {
        return Err(damaged(place, &format!("a matrix of {r} × {c} cannot have {entries} entries; export it again")));
    }
    if kind.symmetric && r != c {
        let what = format!("a symmetric matrix cannot have {r} rows and {c} columns; export it again");
        return Err(damaged(place, &what));
    }
    Ok((r, c, usize::try_from(entries).unwrap_or(usize::MAX)))
}

fn entry(line: &[u8], place: usize, kind: Kind, rows: u32, columns: u32) -> Result<Entry, Fault> {
    let mut words = words(line);
    let mut index = |what: &str, most: u32| {
        let word = words.next().unwrap_or_default();
        integer::<u32>(word).filter(|i| (1..=most).contains(i)).map(|i| i - 1).ok_or_else(|| {
            let word = quoted(word);
            damaged(place, &format!("{word} is not a {what} from 1 to {most}; export the matrix again"))
        })
    };
    let (row, column) = (index("row", rows)?, index("column", columns)?);
    if kind.symmetric && column > row {
        return Err(damaged(place, "a symmetric matrix has entries on and below its diagonal only; export it again"));
    }
    let value = if kind.has_values {
        let word = words.next().unwrap_or_default();
        let what = || format!("{} is not a number; export the matrix again", quoted(word));
        let value = number(word).ok_or_else(|| damaged(place, &what()))?;
        if !value.is_finite() {
            return Err(Fault::invalid(format!("line {place}: the entry is NaN or infinite; repair or remove it")));
        }
        value
    } else {
        1.0
    };
    match words.next() {
        None => Ok(Entry { row, column, value, line: place }),
        Some(word) => Err(damaged(place, &format!("{} follows the entry; give one entry a line", quoted(word)))),
    }
}

fn refuse_repetition(entries: &mut [Entry]) -> Result<(), Fault> {
    entries.sort_by_key(|e| (e.row, e.column));
    let twins = entries.windows(2).find(|pair| (pair[0].row, pair[0].column) == (pair[1].row, pair[1].column));
    twins.map_or(Ok(()), |pair| {
        let (row, column, before) = (pair[1].row + 1, pair[1].column + 1, pair[0].line);
        let what = format!("row {row}, column {column} has an entry on line {before} already; leave one of them");
        Err(damaged(pair[1].line, &what))
    })
}
