//! Reads the files of `core/tests/golden`, whose generators say what is in them.

use cager_core::cage::Cage;
use cager_core::mesh::{Point, TriMesh};
use std::str::{FromStr, SplitAsciiWhitespace};

/// Name, cage, points and their rows of `Φ`.
pub(crate) type Case = (String, Cage, Vec<Point>, Vec<Vec<f64>>);

pub(crate) fn read(text: &str) -> Vec<Case> {
    let mut words = text.split_ascii_whitespace().peekable();
    let mut cases = Vec::new();
    while words.next() == Some("cage") {
        let name: String = next(&mut words);
        let (vertices, faces): (usize, usize) = (next(&mut words), next(&mut words));
        let vertices: Vec<Point> = (0..vertices).map(|_| triple(&mut words)).collect();
        let triangles = (0..faces).map(|_| triple(&mut words)).collect();
        let (mut points, mut rows) = (Vec::new(), Vec::new());
        while words.next_if_eq(&"point").is_some() {
            points.push(triple(&mut words));
            assert_eq!(words.next(), Some("row"), "no row of {name}");
            rows.push((0..vertices.len()).map(|_| next(&mut words)).collect());
        }
        cases.push((name, Cage::new(TriMesh { vertices, triangles }).expect("a valid cage"), points, rows));
    }
    cases
}

type Words<'a> = std::iter::Peekable<SplitAsciiWhitespace<'a>>;

fn next<T: FromStr>(words: &mut Words<'_>) -> T {
    words.next().and_then(|word| word.parse().ok()).expect("a word as the generator writes it")
}

fn triple<T: FromStr>(words: &mut Words<'_>) -> [T; 3] {
    [0, 1, 2].map(|_| next(words))
}
