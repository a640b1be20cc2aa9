//! What refining decided, as bytes: elements, degrees, and how their equations were solved. A
//! decoder repeats it and decides nothing; `docs/FORMAT.md` has the layout.

use super::basis::{MAX_DEGREE, functions};
use super::elements::{Element, LATER, LOW_DEGREES, MIN_DEGREE, QUARTERS, Unknowns};
use super::patch::{DAMPING, MAX_PATCH_UNKNOWNS};
use super::solve::{MAX_ITERATIONS, SolveRecord};
use cager_geometry::mesh::Point;
use serde::{Deserialize, Serialize};

/// The boundary elements that harmonic coordinates were solved on, and how.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct ElementPlan {
    bytes: Vec<u8>,
}

impl ElementPlan {
    /// Takes what [`Self::as_bytes`] gave; it is checked where it is used, together with its cage.
    pub fn from_bytes(bytes: Vec<u8>) -> Self {
        Self { bytes }
    }

    /// As it is stored.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The elements, each face's division in preorder, and the record of the solution.
    pub(super) fn new(unknowns: &Unknowns, record: &SolveRecord) -> Self {
        let mut bytes = vec![unknowns.low_degree as u8, record.damping, record.iterations];
        for element in unknowns.preorder.iter().map(|&k| &unknowns.elements[k]) {
            bytes.extend_from_slice(&element.cuts);
            bytes.push(element.degree as u8);
        }
        bytes.extend_from_slice(&record.patch_damping);
        let count = unknowns.elements.len();
        let mut bits = vec![0; (count * record.patches.len()).div_ceil(8)];
        for (v, patch) in record.patches.iter().enumerate() {
            for &e in patch {
                let bit = v * count + e as usize;
                bits[bit / 8] |= 1 << (bit % 8);
            }
        }
        bytes.extend(bits);
        Self { bytes }
    }

    /// Elements and record for a cage with these faces and so many vertices, or what is wrong with
    /// the bytes. Takes no more memory than elements that refining may make.
    pub(super) fn read(&self, faces: &[[Point; 3]], vertices: usize) -> Result<(Unknowns, SolveRecord), &'static str> {
        let Some((&[low_degree, damping, iterations], mut rest)) = self.bytes.split_first_chunk() else {
            return Err("it is cut");
        };
        let least = usize::from(low_degree);
        if least > LOW_DEGREES[0].1
            || usize::from(damping) >= DAMPING.len()
            || !(1..=MAX_ITERATIONS).contains(&iterations)
        {
            return Err("it begins with numbers that cannot be");
        }
        let most = LOW_DEGREES[2].0 / functions(least);
        let mut elements = Vec::new();
        for (face, &corners) in faces.iter().enumerate() {
            rest = divide(Element::face(face, corners), rest, &mut elements, most)?;
        }
        let unknowns = Unknowns::new(&elements, least);
        let count = unknowns.elements.len();
        if rest.len() != vertices + (count * vertices).div_ceil(8) {
            return Err("it does not have as many faces and vertices as the cage");
        }
        let (patch_damping, bits) = rest.split_at(vertices);
        if patch_damping.iter().any(|&damping| usize::from(damping) >= DAMPING.len()) {
            return Err("it damps what cannot be damped so");
        }
        let is_set = |bit: usize| bits[bit / 8] >> (bit % 8) & 1 == 1;
        if (count * vertices..8 * bits.len()).any(is_set) {
            return Err("it has bits beyond its end");
        }
        let patch_of = |v: usize| {
            let (mut patch, mut size) = (Vec::new(), 0);
            for e in (0..count).filter(|e| is_set(v * count + e)) {
                size += functions(unknowns.elements[e].degree);
                if size > MAX_PATCH_UNKNOWNS {
                    return Err("it solves for too many unknowns around a vertex");
                }
                patch.push(e as u32);
            }
            Ok(patch)
        };
        let patches: Vec<Vec<u32>> = (0..vertices).map(patch_of).collect::<Result<_, _>>()?;
        let record = SolveRecord { damping, iterations, patches, patch_damping: patch_damping.to_vec() };
        Ok((unknowns, record))
    }
}

/// Divides a face by the first bytes, in preorder, and gives the bytes that follow.
fn divide<'a>(
    face: Element,
    mut bytes: &'a [u8],
    elements: &mut Vec<Element>,
    most: usize,
) -> Result<&'a [u8], &'static str> {
    let mut waiting = vec![face];
    while let Some(mut element) = waiting.pop() {
        let Some((&byte, rest)) = bytes.split_first() else { return Err("it has fewer faces than the cage") };
        bytes = rest;
        if byte < 3 || byte == QUARTERS || (LATER..LATER + 3).contains(&byte) {
            waiting.extend(element.parts(byte).into_iter().rev());
        } else if (MIN_DEGREE..=MAX_DEGREE).contains(&usize::from(byte)) {
            element.degree = usize::from(byte);
            // Cut until nothing is left.
            let has_area = element.triangle.height() > 0.0;
            if !has_area {
                return Err("it has an element without area");
            }
            elements.push(element);
        } else {
            return Err("it has an element of a degree that cannot be");
        }
        if elements.len() + waiting.len() > most {
            return Err("it has too many elements");
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faces() -> Vec<[Point; 3]> {
        vec![[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.5]], [[0.0; 3], [0.0, 3.0, 0.0], [1.0, 1.0, 1.0]]]
    }

    /// One face of a degree, the other cut, one half of which is cut into four.
    fn plan() -> ElementPlan {
        let mut bytes = vec![1, 0, 2, 5, LATER + 2, 3, QUARTERS, 3, 4, 6, 3];
        // Four vertices, six elements: 24 bits.
        bytes.extend([0, 0, 1, 0, 0b0100_0001, 0, 0b1000_0000]);
        ElementPlan::from_bytes(bytes)
    }

    #[test]
    fn what_was_written_is_read() {
        let (unknowns, record) = plan().read(&faces(), 4).expect("a plan");
        let degrees: Vec<usize> = unknowns.elements.iter().map(|element| element.degree).collect();
        assert_eq!(degrees, [5, 3, 3, 4, 6, 3]);
        let area = |face: u32| -> f64 {
            unknowns.elements.iter().filter(|element| element.face == face).map(|element| element.triangle.area).sum()
        };
        for (face, corners) in faces().into_iter().enumerate() {
            let whole = Element::face(face, corners).triangle.area;
            assert!((area(face as u32) - whole).abs() < 1e-15, "face {face}");
        }
        assert_eq!(record.patches, [vec![0], vec![0], vec![], vec![5]]);
        assert_eq!((record.iterations, record.patch_damping.as_slice()), (2, &[0, 0, 1, 0][..]));
        assert_eq!(ElementPlan::new(&unknowns, &record), plan());
    }

    #[test]
    fn elements_that_were_cut_before_the_first_solution_come_last() {
        let bytes = [&[1, 0, 1, 1, 3, 4, LATER + 1, 5, 6][..], &[0; 4], &[0; 2]].concat();
        let (unknowns, record) = ElementPlan::from_bytes(bytes.clone()).read(&faces(), 4).expect("a plan");
        let degrees: Vec<usize> = unknowns.elements.iter().map(|element| element.degree).collect();
        assert_eq!(degrees, [5, 6, 3, 4]);
        assert_eq!(ElementPlan::new(&unknowns, &record).as_bytes(), bytes);
    }

    #[test]
    fn bytes_that_do_not_fit_the_cage_are_refused() {
        let bytes = plan().as_bytes().to_vec();
        let read = |bytes: &[u8], faces: &[[Point; 3]], vertices| {
            ElementPlan::from_bytes(bytes.to_vec()).read(faces, vertices).map(|_| ())
        };
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length], &faces(), 4).is_err(), "cut to {length} bytes");
        }
        assert!(read(&[&bytes[..], &[0]].concat(), &faces(), 4).is_err());
        assert!(read(&bytes, &faces()[..1], 4).is_err() && read(&bytes, &[faces(), faces()].concat(), 4).is_err());
        assert!(read(&bytes, &faces(), 3).is_err() && read(&bytes, &faces(), 5).is_err());
        for k in 0..bytes.len() {
            for byte in 0..=255 {
                let mut changed = bytes.clone();
                changed[k] = byte;
                // Whatever is read is a division of the same faces.
                let Ok((unknowns, _)) = ElementPlan::from_bytes(changed).read(&faces(), 4) else { continue };
                assert!(unknowns.elements.iter().all(|element| (3..=6).contains(&element.degree)));
            }
        }
        // Cuts without end, and a patch of everything.
        assert_eq!(read(&[&bytes[..3], &[0; 100_000]].concat(), &faces(), 4), Err("it has too many elements"));
        let many = [&[0, 0, 1, 5][..], &[0; 100], &[6; 101], &[0; 4], &[255; 51]].concat();
        assert_eq!(read(&many, &faces(), 4), Err("it solves for too many unknowns around a vertex"));
    }
}
