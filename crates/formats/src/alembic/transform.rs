//! Transforms above a mesh, still or animated: a stack of operations, of which each has some numbers.

use std::io::{Read, Seek};

use super::objects::{Archive, Kind as ObjectKind};
use super::ogawa::{Container, damaged};
use super::properties::{BOOL, F64, Kind, Property, U8, find};
use super::sampling::Sampling;
use crate::error::Fault;
use crate::scene::{Failure, IDENTITY, Matrix, Objects, between, multiply, rotation};

/// The kind of an operation that is a matrix.
const MATRIX: u8 = 3;
/// Programs write a handful.
const MOST_OPERATIONS: usize = 256;
/// Operations of all animated transforms above a mesh, which are done for every frame.
const MOST_ANIMATED: usize = 1 << 12;

/// The transforms above an object.
pub(super) struct Chain {
    /// From the inside to the outside, without those that are the identity.
    links: Vec<Link>,
}

/// One transform.
struct Link {
    /// The kinds of the operations, outermost first.
    operations: Vec<u8>,
    /// Their numbers, back to back.
    values: Property,
    /// The matrix, where it does not change.
    fixed: Option<Matrix>,
}

impl Chain {
    /// The transforms above an object, up to one that does not inherit what is above it.
    pub(super) fn of<R: Read + Seek>(archive: &mut Archive<R>, object: usize) -> Result<Self, Failure> {
        let mut links = Vec::new();
        for above in archive.ancestry(object).skip(1).collect::<Vec<_>>() {
            if archive.objects[above].kind != ObjectKind::Transform {
                continue;
            }
            let properties = archive.schema(above, ".xform")?;
            links.extend(link(&mut archive.container, &properties)?);
            if !inherits(&mut archive.container, &properties)? {
                break;
            }
        }
        let moving = links.iter().filter(|link: &&Link| link.fixed.is_none());
        if moving.map(|link| link.operations.len()).sum::<usize>() > MOST_ANIMATED {
            return Err(damaged("the transforms above a mesh have more operations than any program writes").into());
        }
        Ok(Self { links })
    }

    /// The properties that change.
    pub(super) fn animated(&self) -> impl Iterator<Item = &Property> {
        self.links.iter().filter(|link| link.fixed.is_none()).map(|link| &link.values)
    }

    /// The product of all transforms at a time in seconds; none for the identity.
    pub(super) fn matrix<R: Read + Seek>(
        &self,
        container: &mut Container<R>,
        samplings: &[Sampling],
        seconds: f64,
    ) -> Result<Option<Matrix>, Failure> {
        let mut product: Option<Matrix> = None;
        for link in &self.links {
            let matrix = match link.fixed {
                Some(fixed) => fixed,
                None => link.at(container, link.values.find(seconds, samplings))?,
            };
            product = Some(product.map_or(matrix, |inner| multiply(&inner, &matrix)));
        }
        match product {
            Some(matrix) if !matrix.as_flattened().iter().all(|x| x.is_finite()) => {
                Err(Fault::invalid("has a transform that is NaN or infinite; repair it or bake it into the points")
                    .into())
            }
            product => Ok(product.filter(|matrix| *matrix != IDENTITY)),
        }
    }
}

/// A transform that does something.
fn link<R: Read + Seek>(container: &mut Container<R>, properties: &[Property]) -> Result<Option<Link>, Failure> {
    let named = |name: &str| properties.iter().find(|property| property.name == name.as_bytes());
    let (Some(operations), Some(values)) = (named(".ops"), named(".vals")) else { return Ok(None) };
    if operations.number != U8 || values.number != F64 || values.samples == 0 || operations.samples == 0 {
        return Err(damaged("a transform has no numbers, or of an unknown type").into());
    }
    let operations = operations.table(container, 0, MOST_OPERATIONS)?;
    let mut link = Link { operations, values: values.clone(), fixed: None };
    let first = link.at(container, (0, 0.0))?;
    if values.is_constant() {
        link.fixed = Some(first);
    }
    Ok((link.fixed != Some(IDENTITY)).then_some(link))
}

/// Whether what is above a transform moves it too.
fn inherits<R: Read + Seek>(container: &mut Container<R>, properties: &[Property]) -> Result<bool, Failure> {
    let Some(told) = find(properties, ".inherits", Kind::Scalar).filter(|told| told.number == BOOL) else {
        return Ok(true);
    };
    if !told.is_constant() {
        let what = "has a transform that is moved by what is above it in some frames only; bake it into the points";
        return Err(Fault::unsupported(what).into());
    }
    Ok(told.table(container, 0, 1)?.first() != Some(&0))
}

impl Link {
    /// The matrix at a sample, or on the way to the next one, where each number is interpolated, and matrices as the rotations that they are.
    fn at<R: Read + Seek>(
        &self,
        container: &mut Container<R>,
        (sample, share): (usize, f64),
    ) -> Result<Matrix, Failure> {
        let mut read = |sample| -> Result<Vec<f64>, Failure> {
            let bytes = self.values.table(container, sample, 8 * 16 * MOST_OPERATIONS)?;
            Ok(bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
        };
        let mut values = read(sample)?;
        if share > 0.0 {
            let next = read(sample + 1)?;
            if matches!(self.operations.as_slice(), [operation] if operation >> 4 == MATRIX) {
                let [from, to] = [&values, &next].map(|values| matrix(&self.operations, values));
                return Ok(between(&from?, &to?, share));
            }
            values.iter_mut().zip(next).for_each(|(value, next)| *value += share * (next - *value));
        }
        Ok(matrix(&self.operations, &values)?)
    }
}

/// The product of some operations.
fn matrix(operations: &[u8], mut values: &[f64]) -> Result<Matrix, Fault> {
    let mut product = IDENTITY;
    for operation in operations {
        let kind = operation >> 4;
        let count = match kind {
            0 | 1 => 3,
            2 => 4,
            MATRIX => 16,
            4..=6 => 1,
            _ => return Err(Fault::unsupported("has a transform of an unknown kind; bake it into the points")),
        };
        let (taken, rest) = values.split_at_checked(count).ok_or_else(|| damaged("a transform has too few numbers"))?;
        values = rest;
        let mut step = IDENTITY;
        match (kind, taken) {
            (0, _) => (0..3).for_each(|k| step[k][k] = taken[k]),
            (1, _) => step[3][..3].copy_from_slice(taken),
            (2, &[x, y, z, degrees]) => step = rotation([x, y, z], degrees),
            (MATRIX, _) => step.as_flattened_mut().copy_from_slice(taken),
            _ => step = rotation([4, 5, 6].map(|axis| f64::from(u8::from(kind == axis))), taken[0]),
        }
        product = multiply(&step, &product);
    }
    Ok(product)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{determinant, placed};

    fn moved(operations: &[u8], values: &[f64], point: [f64; 3]) -> [f64; 3] {
        let mut point = point.to_vec();
        placed(Some(&matrix(operations, values).unwrap()), &mut point, true);
        [point[0], point[1], point[2]].map(|x| (1e9 * x).round() / 1e9)
    }

    #[test]
    fn operations_act_from_the_last_to_the_first() {
        let (scale, translate) = ([2.0, 3.0, 4.0], [10.0, 0.0, 0.0]);
        assert_eq!(moved(&[0x10, 0x00], &[translate, scale].concat(), [1.0, 1.0, 1.0]), [12.0, 3.0, 4.0]);
        assert_eq!(moved(&[0x00, 0x10], &[scale, translate].concat(), [1.0, 1.0, 1.0]), [22.0, 3.0, 4.0]);
        assert_eq!(moved(&[0x20], &[0.0, 0.0, 2.0, 90.0], [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
        assert_eq!(moved(&[0x40], &[90.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
        assert_eq!(moved(&[0x50], &[90.0], [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]);
        let rows: Vec<f64> = (0..16).map(f64::from).collect();
        assert_eq!(moved(&[0x30], &rows, [1.0, 0.0, 0.0]), [12.0, 14.0, 16.0]);
    }

    #[test]
    fn transforms_that_cannot_be_are_refused() {
        assert!(matrix(&[0x70], &[0.0; 16]).is_err());
        assert!(matrix(&[0x30], &[0.0; 15]).is_err());
        assert!(determinant(&matrix(&[0x00], &[-1.0, 1.0, 1.0]).unwrap()) < 0.0 && determinant(&IDENTITY) > 0.0);
    }
}
