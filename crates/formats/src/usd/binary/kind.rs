//! Types of values.

pub(crate) const INT: u8 = 3;
pub(crate) const HALF: u8 = 7;
pub(crate) const FLOAT: u8 = 8;
pub(crate) const DOUBLE: u8 = 9;
pub(crate) const STRING: u8 = 10;
pub(crate) const TOKEN: u8 = 11;
pub(crate) const ASSET: u8 = 12;
pub(crate) const MATRIX4D: u8 = 15;
pub(crate) const QUATD: u8 = 16;
pub(crate) const QUATF: u8 = 17;
pub(crate) const QUATH: u8 = 18;
pub(crate) const VEC2F: u8 = 20;
pub(crate) const VEC3D: u8 = 23;
pub(crate) const VEC3F: u8 = 24;
pub(crate) const VEC3H: u8 = 25;
pub(crate) const VEC4F: u8 = 28;
pub(crate) const TOKEN_LIST: u8 = 32;
pub(crate) const PATH_LIST: u8 = 34;
pub(crate) const TOKENS: u8 = 41;
pub(crate) const SPECIFIER: u8 = 42;
pub(crate) const VARIABILITY: u8 = 44;
pub(crate) const TIME_SAMPLES: u8 = 46;
pub(crate) const DOUBLES: u8 = 48;
pub(crate) const BLOCKED: u8 = 51;
