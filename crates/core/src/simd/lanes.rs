//! A value for each of eight points, and their arithmetic.

use cager_geometry::mesh::Point;
use faer::MatMut;
use std::ops::{Add, Mul, Sub};

/// Points or entries that one lane group holds.
pub(crate) const LANES: usize = 8;

macro_rules! lanes {
    ($(#[$meta:meta])* $name:ident, $real:ident, $align:literal) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug)]
        #[repr(align($align))]
        pub(crate) struct $name(pub(crate) [$real; LANES]);

        impl $name {
            pub(crate) const ZERO: Self = Self([0.0; LANES]);

            #[inline(always)]
            pub(crate) fn splat(value: $real) -> Self {
                Self([value; LANES])
            }

            #[inline(always)]
            pub(crate) fn map(self, f: impl Fn($real) -> $real) -> Self {
                let mut out = [0.0; LANES];
                for l in 0..LANES {
                    out[l] = f(self.0[l]);
                }
                Self(out)
            }

            #[inline(always)]
            pub(crate) fn zip(self, other: Self, f: impl Fn($real, $real) -> $real) -> Self {
                let mut out = [0.0; LANES];
                for l in 0..LANES {
                    out[l] = f(self.0[l], other.0[l]);
                }
                Self(out)
            }

            #[inline(always)]
            pub(crate) fn sqrt(self) -> Self {
                self.map($real::sqrt)
            }
        }
        lanewise!($name, $real, Add, add, +);
        lanewise!($name, $real, Sub, sub, -);
        lanewise!($name, $real, Mul, mul, *);
        lanewise!($name, $real, Div, div, /);
    };
}

macro_rules! lanewise {
    ($name:ident, $real:ident, $trait:ident, $method:ident, $op:tt) => {
        impl std::ops::$trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $op b)
            }
        }
        impl std::ops::$trait<$real> for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: $real) -> Self {
                self.map(|a| a $op other)
            }
        }
    };
}

lanes! {
    /// One value for each point or entry of a lane group.
    Lanes, f64, 64
}

lanes! {
    /// The same in single precision.
    Singles, f32, 32
}

impl Lanes {
    /// Whether `f` holds for any pair of lanes.
    #[inline(always)]
    pub(crate) fn any(self, other: Self, f: impl Fn(f64, f64) -> bool) -> bool {
        let mut found = false;
        for l in 0..LANES {
            found |= f(self.0[l], other.0[l]);
        }
        found
    }
}

/// The points that a lane group holds, coordinate by coordinate.
#[inline(always)]
pub(crate) fn gather(point: impl Fn(usize) -> Point) -> [Lanes; 3] {
    let mut x = [Lanes::ZERO; 3];
    for l in 0..LANES {
        let p = point(l);
        for k in 0..3 {
            x[k].0[l] = p[k];
        }
    }
    x
}

/// Points in lane groups, the last one filled up with `beyond`.
pub(crate) fn grouped(points: &[Point], beyond: Point) -> Vec<[Lanes; 3]> {
    points.chunks(LANES).map(|points| gather(|l| points.get(l).copied().unwrap_or(beyond))).collect()
}

/// Writes lane groups, one for each column, into the rows from `start` on, as far as there are rows.
pub(crate) fn store<T: Copy>(mut rows: MatMut<'_, T>, start: usize, groups: impl Iterator<Item = [T; LANES]>) {
    let count = LANES.min(rows.nrows() - start);
    for (j, values) in groups.enumerate() {
        let mut entries = rows.as_mut().col_mut(j).subrows_mut(start, count);
        match entries.as_mut().try_as_col_major_mut() {
            Some(entries) => entries.as_slice_mut().copy_from_slice(&values[..count]),
            None => entries.iter_mut().zip(values).for_each(|(entry, value)| *entry = value),
        }
    }
}

/// What dot and cross products take: a lane group of either precision.
pub(crate) trait Arithmetic: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {}
impl<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T>> Arithmetic for T {}

#[inline(always)]
pub(crate) fn dot<T: Arithmetic>(a: &[T; 3], b: &[T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross<T: Arithmetic>(a: &[T; 3], b: &[T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `Σ cₖ zᵏ` by Estrin's scheme: four short chains instead of one of eleven dependent steps.
#[inline(always)]
pub(super) fn polynomial(c: &[f64; 12], z: Lanes) -> Lanes {
    let pair = |k: usize| z * c[k + 1] + c[k];
    let z2 = z * z;
    let z4 = z2 * z2;
    let low = pair(0) + pair(2) * z2;
    let mid = pair(4) + pair(6) * z2;
    let high = pair(8) + pair(10) * z2;
    low + (mid + high * z4) * z4
}
