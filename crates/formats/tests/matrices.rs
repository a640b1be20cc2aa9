//! Sparse matrices: what is read, and what every mistake is told.

use cager_formats::{Error, read_matrix_bytes};
use std::path::Path;

fn read(text: &str) -> Result<Vec<(u32, u32, f64)>, Error> {
    Ok(read_matrix_bytes(Path::new("d.mtx"), text.as_bytes())?.entries().to_vec())
}

#[test]
fn every_kind_is_read() {
    let real = "%%MatrixMarket matrix coordinate real general\n% a remark\n\n2 3 3\n2 1 -4.5e-1\n1 3 2\n1 1 1\n";
    assert_eq!(read(real).unwrap(), [(0, 0, 1.0), (0, 2, 2.0), (1, 0, -0.45)]);
    let symmetric = "%%matrixmarket MATRIX coordinate Integer Symmetric\r\n3 3 2\r\n2 2 5\r\n3 1 -1\r\n";
    assert_eq!(read(symmetric).unwrap(), [(0, 2, -1.0), (1, 1, 5.0), (2, 0, -1.0)]);
    let pattern = "%%MatrixMarket matrix coordinate pattern general\n4 2 2\n4 2\n1 1";
    assert_eq!(read(pattern).unwrap(), [(0, 0, 1.0), (3, 1, 1.0)]);
    let matrix = read_matrix_bytes(Path::new("d.mtx"), pattern.as_bytes()).unwrap();
    assert_eq!((matrix.rows(), matrix.columns()), (4, 2));
    assert!(read("%%MatrixMarket matrix coordinate real general\n4 2 0\n").unwrap().is_empty());
}

#[test]
fn every_mistake_is_named_with_its_line() {
    let head = "%%MatrixMarket matrix coordinate real general\n";
    let cases = [
        ("", "line 1: this is not a matrix"),
        ("1 2 3\n", "line 1: this is not a matrix"),
        ("%%MatrixMarket matrix array real general\n2 2\n", "line 1: the layout \"array\""),
        ("%%MatrixMarket matrix coordinate complex general\n", "line 1: entries of the kind \"complex\""),
        ("%%MatrixMarket matrix coordinate real hermitian\n", "line 1: the symmetry \"hermitian\""),
        (head, "the numbers of rows, columns and entries are missing"),
        (&format!("{head}2 2\n"), "line 2: the numbers of rows"),
        (&format!("{head}2 2 1 7\n1 1 1\n"), "line 2: \"7\" follows"),
        (&format!("{head}2 2 5\n1 1 1\n"), "line 2: a matrix of 2 × 2 cannot have 5 entries"),
        (&format!("{head}4000000000 4000000000 1000000000000\n1 1 1\n"), "line 2: 1000000000000 entries are promised"),
        (&format!("{head}18446744073709551615 1 1\n1 1 1\n"), "line 2: 18446744073709551615 × 1 is larger"),
        (&format!("{head}2 2 2\n1 1 1\n"), "ends after 1 of 2 entries"),
        (&format!("{head}2 2 1\n1 1 1\n2 2 1\n"), "line 4: there are more than the 1 entries"),
        (&format!("{head}2 2 1\n0 1 1\n"), "line 3: \"0\" is not a row from 1 to 2"),
        (&format!("{head}2 2 1\n1 3 1\n"), "line 3: \"3\" is not a column from 1 to 2"),
        (&format!("{head}2 2 1\n1\n"), "line 3: \"\" is not a column"),
        (&format!("{head}2 2 1\n1 1 nan\n"), "line 3: the entry is NaN or infinite"),
        (&format!("{head}2 2 1\n1 1 1e999\n"), "line 3: the entry is NaN or infinite"),
        (&format!("{head}2 2 1\n1 1 1e200\n"), "beyond 1e100"),
        (&format!("{head}2 2 1\n1 1 x\n"), "line 3: \"x\" is not a number"),
        (&format!("{head}2 2 1\n1 1 1 1\n"), "line 3: \"1\" follows the entry"),
        (&format!("{head}2 2 3\n1 1 1\n2 1 1\n1 1 4\n"), "line 5: row 1, column 1 has an entry on line 3 already"),
        ("%%MatrixMarket matrix coordinate real symmetric\n2 3 1\n1 1 1\n", "line 2: a symmetric matrix cannot have"),
        ("%%MatrixMarket matrix coordinate real symmetric\n2 2 1\n1 2 1\n", "line 3: a symmetric matrix has entries"),
    ];
    for (text, expected) in cases {
        let said = read(text).expect_err(text).to_string();
        assert!(said.starts_with("d.mtx: ") && said.contains(expected), "{text:?}: {said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}
