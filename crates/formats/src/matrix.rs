//! Sparse matrices as text: Matrix Market, coordinate format (Boisvert, Pozo and Remington 1996).

use crate::error::{Error, Fault};
use crate::signature::Signature;
use crate::text::{Lines, integer, number, quoted, words};
use cager_geometry::linalg::SparseMatrix;
use std::fmt::Display;
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

/// What the first line and the one of the sizes say.
struct Header {
    /// Values are written out; otherwise they are ones.
    has_values: bool,
    /// Only the lower triangle is written.
    symmetric: bool,
    rows: u32,
    columns: u32,
    entries: usize,
}

/// An entry and the line it came from.
struct Entry {
    row: u32,
    column: u32,
    value: f64,
    line: usize,
}

fn damaged(line: usize, what: impl Display) -> Fault {
    Fault::damaged(format!("line {line}: {what}; export the matrix again"))
}

fn read(bytes: &[u8]) -> Result<SparseMatrix, Fault> {
    let mut lines = Lines::new(bytes);
    let header = header(&mut lines)?;
    let promised = header.entries;
    if promised > lines.rest().len() / SHORTEST_ENTRY + 1 {
        let what = format!("{promised} entries are promised, more than the file can hold");
        return Err(damaged(lines.number(), what));
    }
    let mut entries = Vec::with_capacity(promised);
    while let Some(line) = lines.next() {
        if line.is_empty() || line.starts_with(b"%") {
            continue;
        }
        if entries.len() == promised {
            let what = format!("there are more than the {promised} entries that are promised");
            return Err(damaged(lines.number(), what));
        }
        entries.push(entry(line, lines.number(), &header)?);
    }
    if entries.len() < promised {
        let found = entries.len();
        return Err(Fault::damaged(format!("ends after {found} of {promised} entries; copy or export the file again")));
    }
    entries.sort_by_key(|e| (e.row, e.column));
    if let Some([a, b]) = entries.windows(2).find(|pair| (pair[0].row, pair[0].column) == (pair[1].row, pair[1].column))
    {
        let (row, column, line) = (b.row + 1, b.column + 1, a.line);
        return Err(damaged(b.line, format!("row {row}, column {column} has an entry on line {line} already")));
    }
    let mirrored = |e: &Entry| (header.symmetric && e.row != e.column).then_some((e.column, e.row, e.value));
    let all = entries.iter().flat_map(|e| [Some((e.row, e.column, e.value)), mirrored(e)]).flatten().collect();
    SparseMatrix::new(header.rows as usize, header.columns as usize, all)
        .ok_or_else(|| Fault::invalid("has an entry beyond 1e100, which cannot be squared; scale the matrix down"))
}

fn header(lines: &mut Lines<'_>) -> Result<Header, Fault> {
    let unread = |what: &str| {
        Err(Fault::unsupported(format!(
            "line 1: {what}; give a file that begins with \"%%MatrixMarket matrix coordinate real general\""
        )))
    };
    let first = lines.next().unwrap_or_default().to_ascii_lowercase();
    let mut found = words(&first);
    let mut next = || found.next().unwrap_or_default();
    if [next(), next()] != [&b"%%matrixmarket"[..], b"matrix"] {
        return unread("this is not a matrix in the Matrix Market format");
    }
    let [layout, field, symmetry] = [next(), next(), next()];
    if layout != b"coordinate" {
        return unread(&format!("the layout {} is not read here", quoted(layout)));
    }
    let (has_values, symmetric) = match (field, symmetry) {
        (b"real" | b"integer" | b"pattern", b"general" | b"symmetric") => {
            (field != b"pattern", symmetry == b"symmetric")
        }
        (b"real" | b"integer" | b"pattern", _) => {
            return unread(&format!("the symmetry {} is not read here", quoted(symmetry)));
        }
        _ => return unread(&format!("entries of the kind {} are not read here", quoted(field))),
    };

    let line = lines.by_ref().find(|line| !line.is_empty() && !line.starts_with(b"%")).unwrap_or_default();
    let (place, mut numbers) = (lines.number(), words(line));
    let mut next = || numbers.next().and_then(integer::<u64>);
    let (Some(r), Some(c), Some(entries)) = (next(), next(), next()) else {
        return Err(damaged(place, "the numbers of rows, columns and entries are missing"));
    };
    if let Some(word) = numbers.next() {
        return Err(damaged(place, format!("{} follows the numbers of rows, columns and entries", quoted(word))));
    }
    let (Ok(rows), Ok(columns)) = (u32::try_from(r), u32::try_from(c)) else {
        return Err(Fault::unsupported(format!(
            "line {place}: {r} × {c} is larger than any matrix read here; leave out what does not belong to the cage"
        )));
    };
    if entries > r * c {
        return Err(damaged(place, format!("a matrix of {r} × {c} cannot have {entries} entries")));
    }
    if symmetric && r != c {
        return Err(damaged(place, format!("a symmetric matrix cannot have {r} rows and {c} columns")));
    }
    let entries = usize::try_from(entries).unwrap_or(usize::MAX);
    Ok(Header { has_values, symmetric, rows, columns, entries })
}

fn entry(line: &[u8], place: usize, header: &Header) -> Result<Entry, Fault> {
    let mut words = words(line);
    let mut index = |what: &str, most: u32| {
        let word = words.next().unwrap_or_default();
        let wrong = || damaged(place, format!("{} is not a {what} from 1 to {most}", quoted(word)));
        integer::<u32>(word).filter(|i| (1..=most).contains(i)).map(|i| i - 1).ok_or_else(wrong)
    };
    let (row, column) = (index("row", header.rows)?, index("column", header.columns)?);
    if header.symmetric && column > row {
        return Err(damaged(place, "a symmetric matrix has entries on and below its diagonal only"));
    }
    let mut value = 1.0;
    if header.has_values {
        let word = words.next().unwrap_or_default();
        value = number(word).ok_or_else(|| damaged(place, format!("{} is not a number", quoted(word))))?;
        if !f64::is_finite(value) {
            return Err(Fault::invalid(format!("line {place}: the entry is NaN or infinite; repair or remove it")));
        }
    }
    match words.next() {
        None => Ok(Entry { row, column, value, line: place }),
        Some(word) => {
            Err(Fault::damaged(format!("line {place}: {} follows the entry; give one entry a line", quoted(word))))
        }
    }
}
