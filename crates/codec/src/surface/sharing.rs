//! Which corners of a point share a value. Across an edge both ends are mostly shared, or, at a seam, neither is.

use crate::entropy::{BinaryModel, Coder, Decoder, Encoder, Integers, Models};
use crate::error::{Error, Result};
use cager_geometry::mesh::Polygons;
use std::collections::HashMap;

/// Codes which corners of each point have the same of these numbers.
pub(super) fn encode(faces: &Polygons, points: usize, given: &[u32]) -> Vec<u8> {
    let mut coder = Encoder::default();
    code(&mut coder, faces, points, Some(given));
    coder.into_bytes()
}

/// A number for each corner, counted from 0 as they come: corners of a point that shared one share one. And how many
/// there are.
pub(super) fn decode(bytes: &[u8], faces: &Polygons, points: usize) -> Result<(Vec<u32>, usize)> {
    let mut coder = Decoder::new(bytes)?;
    let (corners, count) =
        code(&mut coder, faces, points, None).ok_or(Error::Damaged("corners share what is not there"))?;
    coder.check()?;
    Ok((corners, count))
}

/// The values of each point, newest first, with the numbers that they are given.
struct ValuesOfPoints {
    newest: Vec<u32>,
    older: Vec<u32>,
    given: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl ValuesOfPoints {
    fn new(points: usize) -> Self {
        Self { newest: vec![NONE; points], older: Vec::new(), given: Vec::new() }
    }

    fn add(&mut self, point: u32, given: u32) -> u32 {
        let number = self.given.len() as u32;
        self.older.push(std::mem::replace(&mut self.newest[point as usize], number));
        self.given.push(given);
        number
    }

    fn iter(&self, point: u32) -> impl Iterator<Item = u32> {
        let known = |number: u32| (number != NONE).then_some(number);
        std::iter::successors(known(self.newest[point as usize]), move |&k| known(self.older[k as usize]))
    }

    fn find(&self, point: u32, given: u32) -> Option<u32> {
        self.iter(point).find(|&number| self.given[number as usize] == given)
    }
}

/// What the face across an edge says of a corner.
#[derive(Clone, Copy)]
struct Across {
    number: u32,
    /// 1: the other end of the edge is shared, 2: it is not known yet, 3: it is not shared.
    other_end: usize,
}

fn code(coder: &mut impl Coder, faces: &Polygons, points: usize, given: Option<&[u32]>) -> Option<(Vec<u32>, usize)> {
    let mut values = ValuesOfPoints::new(points);
    let mut corners: Vec<u32> = Vec::with_capacity(faces.indices().len());
    // For each directed edge of the faces so far the numbers at its ends.
    let mut edges: HashMap<[u32; 2], [u32; 2]> = HashMap::with_capacity(faces.indices().len());
    let (mut first, mut second) = ([BinaryModel::default(); 16], [BinaryModel::default(); 4]);
    let mut places = Integers::new(1);
    for face in faces.iter() {
        let begin = corners.len();
        for (k, &point) in face.iter().enumerate() {
            let known = given.map(|given| values.find(point, given[begin + k]));
            let (before, after) = ((k + face.len() - 1) % face.len(), (k + 1) % face.len());
            let look = |edge: [u32; 2], other: usize, at: usize| {
                let numbers = edges.get(&edge)?;
                let other_end = match corners.get(begin + other) {
                    Some(&number) if number == numbers[1 - at] => 1,
                    Some(_) => 3,
                    None => 2,
                };
                Some(Across { number: numbers[at], other_end })
            };
            let mut across = [look([point, face[before]], before, 0), look([face[after], point], after, 1)];
            let state = |a: Option<Across>| a.map_or(0, |a| a.other_end);
            let context = 4 * state(across[0]) + state(across[1]);
            across.sort_by_key(|a| a.map_or(4, |a| a.other_end));
            let newest = values.iter(point).next();
            let Some(guess) = across[0].map(|a| a.number).or(newest) else {
                corners.push(values.add(point, given.map_or(0, |given| given[begin + k])));
                continue;
            };
            let is = |number: u32| known.is_some_and(|known| known == Some(number));
            if coder.bit(&mut first[context], is(guess)) {
                corners.push(guess);
                continue;
            }
            let other = across[1].map(|a| a.number).filter(|&number| number != guess);
            if let Some(other) = other
                && coder.bit(&mut second[state(across[1])], is(other))
            {
                corners.push(other);
                continue;
            }
            // 0 for a new one, or the place among those that were not ruled out.
            let rest = || values.iter(point).filter(|&number| number != guess && Some(number) != other);
            let place = known.flatten().and_then(|number| rest().position(|k| k == number));
            let place = places.natural(coder, 0, place.map_or(0, |place| place as u32 + 1));
            let old = match place.checked_sub(1) {
                None => None,
                Some(place) => Some(rest().nth(place as usize)?),
            };
            corners.push(old.unwrap_or_else(|| values.add(point, given.map_or(0, |given| given[begin + k]))));
        }
        for (k, &point) in face.iter().enumerate() {
            let after = (k + 1) % face.len();
            edges.insert([point, face[after]], [corners[begin + k], corners[begin + after]]);
        }
    }
    Some((corners, values.given.len()))
}
