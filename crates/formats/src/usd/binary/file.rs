//! Values of a binary layer: what they are, and where.

use super::kind;
use super::pack::integers;
use crate::error::Fault;
use crate::frames::{Scalar, half_precision};
use crate::scene::{Source, damaged};

pub(crate) const MAGIC: &[u8; 8] = b"PXR-USDC";

/// A value as fields have it: its type, and the value itself or where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rep(pub(super) u64);

impl Rep {
    pub(super) fn kind(self) -> u8 {
        (self.0 >> 48) as u8
    }

    pub(super) fn is_array(self) -> bool {
        self.0 >> 63 != 0
    }

    pub(super) fn is_inlined(self) -> bool {
        self.0 >> 62 & 1 != 0
    }

    pub(super) fn is_packed(self) -> bool {
        self.0 >> 61 & 1 != 0
    }

    pub(super) fn offset(self) -> u64 {
        self.0 & ((1 << 48) - 1)
    }

    pub(super) fn inlined(self) -> [u8; 4] {
        (self.0 as u32).to_le_bytes()
    }
}

pub(super) struct File<'a> {
    pub(super) source: Source<'a>,
    /// The minor version of the format, of which the major one is 0.
    pub(super) version: u8,
}

impl File<'_> {
    /// Where the elements of an array begin, and how many they are.
    pub(super) fn elements(&mut self, rep: Rep) -> Result<(u64, u64), Fault> {
        let start = rep.offset();
        match (start, self.version) {
            (0, _) => Ok((0, 0)),
            // Behind the number of dimensions.
            (_, ..5) => Ok((start + 8, u32::from_le_bytes(self.source.array(start + 4)?).into())),
            (_, ..7) => Ok((start + 4, u32::from_le_bytes(self.source.array(start)?).into())),
            _ => Ok((start + 8, self.source.number(start)?)),
        }
    }

    /// The numbers of one value.
    pub(super) fn numbers(&mut self, rep: Rep) -> Result<Vec<f64>, Fault> {
        let small = rep.inlined();
        let bytes = small.map(|byte| f64::from(byte as i8));
        let (scalar, count) = match (rep.kind(), rep.is_inlined()) {
            _ if rep.is_array() => return Err(damaged("it has an array where one value belongs")),
            (kind::INT, true) => return Ok(vec![i32::from_le_bytes(small).into()]),
            (kind::HALF, true) => return Ok(vec![half_precision(u16::from_le_bytes([small[0], small[1]]))]),
            (kind::FLOAT | kind::DOUBLE, true) => return Ok(vec![f32::from_le_bytes(small).into()]),
            (kind::VEC3D | kind::VEC3F | kind::VEC3H, true) => return Ok(bytes[..3].to_vec()),
            (kind::MATRIX4D, true) => {
                return Ok((0..16).map(|k| if k % 5 == 0 { bytes[k / 5] } else { 0.0 }).collect());
            }
            (kind::DOUBLE, false) => (Scalar::F64Little, 1),
            (kind::VEC3D, false) => (Scalar::F64Little, 3),
            (kind::QUATD, false) => (Scalar::F64Little, 4),
            (kind::MATRIX4D, false) => (Scalar::F64Little, 16),
            (kind::VEC3F, false) => (Scalar::F32Little, 3),
            (kind::QUATF, false) => (Scalar::F32Little, 4),
            (kind::VEC3H, false) => (Scalar::F16Little, 3),
            (kind::QUATH, false) => (Scalar::F16Little, 4),
            (kind::BLOCKED, _) => {
                return Err(Fault::unsupported("has a value that is blocked at a time; export it again"));
            }
            (kind, _) => return Err(damaged(&format!("it has a value of type {kind} where numbers belong"))),
        };
        self.source.check(rep.offset(), count, scalar.size() as u64)?;
        let mut numbers = vec![0.0; count as usize];
        self.source.values(rep.offset(), scalar, &mut numbers)?;
        Ok(numbers)
    }

    /// The numbers of an array of at most so many vectors of `width` numbers, or of one vector.
    pub(super) fn vectors(&mut self, rep: Rep, width: usize, most: u64) -> Result<Vec<f64>, Fault> {
        if !rep.is_array() {
            let numbers = self.numbers(rep)?;
            let is_fit = numbers.len() == width;
            return if is_fit { Ok(numbers) } else { Err(other_vectors(width)) };
        }
        let (scalar, found) = match rep.kind() {
            kind::HALF => (Scalar::F16Little, 1),
            kind::FLOAT => (Scalar::F32Little, 1),
            kind::DOUBLE => (Scalar::F64Little, 1),
            kind::VEC2H => (Scalar::F16Little, 2),
            kind::VEC2F => (Scalar::F32Little, 2),
            kind::VEC2D => (Scalar::F64Little, 2),
            kind::VEC3H => (Scalar::F16Little, 3),
            kind::VEC3F => (Scalar::F32Little, 3),
            kind::VEC3D => (Scalar::F64Little, 3),
            kind::VEC4H => (Scalar::F16Little, 4),
            kind::VEC4F => (Scalar::F32Little, 4),
            kind::VEC4D => (Scalar::F64Little, 4),
            kind::QUATH => (Scalar::F16Little, 4),
            kind::QUATF => (Scalar::F32Little, 4),
            kind::QUATD => (Scalar::F64Little, 4),
            kind::MATRIX4D => (Scalar::F64Little, 16),
            _ => return Err(other_vectors(width)),
        };
        let (start, count) = self.elements(rep)?;
        if found != width || count > most {
            return Err(other_vectors(width));
        }
        if rep.is_packed() && count > 0 {
            return self.packed_numbers(start, scalar, count);
        }
        self.unpacked_numbers(start, scalar, count.saturating_mul(width as u64))
    }

    fn unpacked_numbers(&mut self, start: u64, scalar: Scalar, count: u64) -> Result<Vec<f64>, Fault> {
        self.source.check(start, count, scalar.size() as u64)?;
        let mut numbers = vec![0.0; self.source.allowance.take(count, 12)?];
        self.source.values(start, scalar, &mut numbers)?;
        Ok(numbers)
    }

    /// Numbers that are whole, or a table of numbers and which of them is where.
    fn packed_numbers(&mut self, start: u64, scalar: Scalar, count: u64) -> Result<Vec<f64>, Fault> {
        let (mut at, mut table) = (start + 1, None);
        match self.source.array(start)? {
            [b'i'] => {}
            [b't'] => {
                let length = u32::from_le_bytes(self.source.array(at)?);
                table = Some(self.unpacked_numbers(at + 4, scalar, length.into())?);
                at += 4 + u64::from(length) * scalar.size() as u64;
            }
            _ => return Err(damaged("an array of numbers is packed in an unknown way")),
        }
        let length = self.source.number(at)?;
        let packed = self.source.bytes(at.saturating_add(8), length, 1)?;
        let numbers = integers(&packed, self.source.allowance.take(count, 8)?)?;
        let Some(table) = table else { return Ok(numbers.into_iter().map(f64::from).collect()) };
        let number = |&k: &i32| usize::try_from(k).ok().and_then(|k| table.get(k).copied());
        let all: Option<Vec<f64>> = numbers.iter().map(number).collect();
        all.ok_or_else(|| damaged("an array has a number that is not in its table"))
    }
}

fn other_vectors(width: usize) -> Fault {
    damaged(&format!("it has another value where vectors of {width} numbers belong, or more of them than there may be"))
}
