//! Values of a binary layer: what they are, and where.

use super::kind;
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
}
