//! Transforms above a mesh, still or animated: stacks of operations, each of some numbers.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::track::{Track, Values};
use crate::error::Fault;

/// Operations of one transform, and of all above a mesh; programs write a handful.
pub(crate) const MOST_OPERATIONS: usize = 256;
const MOST_ABOVE: usize = 1 << 12;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Operation {
    /// Along so many axes from this one on.
    Translate(usize, usize),
    Scale(usize, usize),
    /// By degrees about these axes, the first one first.
    Rotate(&'static [usize]),
    /// About any axis, by the degrees behind it.
    Turn,
    /// By a quaternion, its real part last.
    Orient,
    /// Sixteen numbers, which are each interpolated.
    Matrix,
    /// The same, interpolated as place, sizes and rotation, unless they shear or mirror.
    Rigid,
}

impl Operation {
    pub(crate) fn count(self) -> usize {
        match self {
            Self::Translate(_, count) | Self::Scale(_, count) => count,
            Self::Rotate([_]) => 1,
            Self::Rotate(_) => 3,
            Self::Turn | Self::Orient => 4,
            Self::Matrix | Self::Rigid => 16,
        }
    }

    fn matrix(self, values: &[f64]) -> DAffine3 {
        let along = |axis: usize, all: f64| {
            let mut vector = [all; 3];
            vector[axis..][..values.len()].copy_from_slice(values);
            DVec3::from(vector)
        };
        match self {
            Self::Translate(axis, _) => DAffine3::from_translation(along(axis, 0.0)),
            Self::Scale(axis, _) => DAffine3::from_scale(along(axis, 1.0)),
            Self::Rotate(axes) => {
                // Three angles are in the order of the axes, whatever is done first.
                let degrees = |axis: usize| values[if axes.len() == 1 { 0 } else { axis }];
                let about = |&axis: &usize| rotation(DVec3::AXES[axis], degrees(axis));
                axes.iter().map(about).fold(DAffine3::IDENTITY, |product, next| next * product)
            }
            Self::Turn => rotation(DVec3::from_slice(values), values[3]),
            // As OpenUSD has it: quaternions are not made to be of length 1.
            Self::Orient => DAffine3::from_mat3(DMat3::from_quat(DQuat::from_slice(values))),
            Self::Matrix | Self::Rigid => affine(values),
        }
    }

    /// The matrix on the way from some numbers to others.
    fn between(self, from: &[f64], to: &[f64], share: f64) -> DAffine3 {
        if share == 0.0 {
            return self.matrix(from);
        }
        let line: Vec<f64> = from.iter().zip(to).map(|(from, to)| from + share * (to - from)).collect();
        match self {
            Self::Orient => {
                let turned = DQuat::from_slice(from).slerp(DQuat::from_slice(to), share);
                DAffine3::from_mat3(DMat3::from_quat(turned))
            }
            Self::Rigid => {
                let mut matrix = self.matrix(&line);
                let parts = [from, to].map(|values| rigid(&self.matrix(values)));
                if let [Some((sizes, start)), Some((larger, end))] = parts {
                    let rotation = DMat3::from_quat(start.slerp(end, share));
                    matrix.matrix3 = rotation * DMat3::from_diagonal(sizes.lerp(larger, share));
                }
                matrix
            }
            _ => self.matrix(&line),
        }
    }
}

/// The matrix of sixteen numbers, of which the last column is passed over: vectors are rows.
pub(crate) fn affine(values: &[f64]) -> DAffine3 {
    let row = |k: usize| DVec3::from_slice(&values[4 * k..]);
    DAffine3::from_cols(row(0), row(1), row(2), row(3))
}

/// About an axis; the identity where there is none.
fn rotation(axis: DVec3, degrees: f64) -> DAffine3 {
    let axis = axis.try_normalize();
    axis.map_or(DAffine3::IDENTITY, |axis| DAffine3::from_axis_angle(axis, degrees.to_radians()))
}

/// The sizes of a matrix's axes and its rotation, where it is no more than these and a translation.
fn rigid(matrix: &DAffine3) -> Option<(DVec3, DQuat)> {
    let axes = [matrix.matrix3.x_axis, matrix.matrix3.y_axis, matrix.matrix3.z_axis];
    let sizes = DVec3::from(axes.map(DVec3::length));
    let is_square = (0..3).all(|k| {
        let next = (k + 1) % 3;
        axes[k].dot(axes[next]).abs() <= 1e-6 * sizes[k] * sizes[next]
    });
    let rotation = DMat3::from_cols(axes[0] / sizes.x, axes[1] / sizes.y, axes[2] / sizes.z);
    (is_square && matrix.matrix3.determinant() > 0.0).then(|| (sizes, DQuat::from_mat3(&rotation)))
}

/// The transforms above a mesh, from the inside to the outside, without those that do nothing.
#[derive(Default)]
pub(crate) struct Chain(Vec<Link>);

/// Operations whose numbers are in one attribute, the last of which is done first.
struct Link {
    values: Track,
    operations: Vec<Operation>,
    is_inverted: bool,
    /// The matrix, where it does not change.
    fixed: Option<DAffine3>,
}

impl Chain {
    /// Adds operations that are done after all that are there.
    pub(crate) fn push(
        &mut self,
        source: &mut (impl Values + ?Sized),
        values: Track,
        operations: Vec<Operation>,
        is_inverted: bool,
    ) -> Result<(), Fault> {
        let mut link = Link { values, operations, is_inverted, fixed: None };
        // A single sample holds at all times, whatever the default.
        let matrix = link.at(source, link.values.times.first().copied().unwrap_or_default())?;
        if link.values.times.len() < 2 {
            link.fixed = Some(matrix);
        }
        if link.fixed != Some(DAffine3::IDENTITY) {
            self.0.push(link);
        }
        if self.0.iter().map(|link| link.operations.len()).sum::<usize>() > MOST_ABOVE {
            let what = "the transforms above a mesh have more operations than any program writes, so the file is \
                        damaged; copy or export it again";
            return Err(Fault::damaged(what));
        }
        Ok(())
    }

    /// Where it moves, the times of that.
    pub(crate) fn moving(&self) -> impl Iterator<Item = &[f64]> {
        self.0.iter().filter(|link| link.fixed.is_none()).map(|link| link.values.times.as_slice())
    }

    /// The product of all transforms at a time; none for the identity.
    pub(crate) fn matrix(&self, source: &mut (impl Values + ?Sized), time: f64) -> Result<Option<DAffine3>, Fault> {
        let mut product = DAffine3::IDENTITY;
        for link in &self.0 {
            let matrix = match link.fixed {
                Some(fixed) => fixed,
                None => link.at(source, time)?,
            };
            product = matrix * product;
        }
        if !product.is_finite() {
            let what = "has a transform that is NaN or infinite, or undone where it cannot be; repair it or bake it \
                        into the points";
            return Err(Fault::invalid(what));
        }
        Ok(Some(product).filter(|matrix| *matrix != DAffine3::IDENTITY))
    }
}

impl Link {
    fn at(&self, source: &mut (impl Values + ?Sized), time: f64) -> Result<DAffine3, Fault> {
        let Some((value, next, share)) = self.values.at(time) else { return Ok(DAffine3::IDENTITY) };
        let from = source.numbers(value)?;
        let to = if share > 0.0 { source.numbers(next)? } else { from.clone() };
        let (mut product, mut start) = (DAffine3::IDENTITY, 0);
        for operation in &self.operations {
            let range = start..start + operation.count();
            start = range.end;
            let (Some(from), Some(to)) = (from.get(range.clone()), to.get(range)) else {
                let what = "a transform has too few numbers, so the file is damaged; copy or export it again";
                return Err(Fault::damaged(what));
            };
            product *= operation.between(from, to, share);
        }
        Ok(if self.is_inverted { product.inverse() } else { product })
    }
}

/// Moves points by a matrix, where there is one; gives whether all is finite, as they `were`.
pub(crate) fn place(matrix: Option<DAffine3>, points: &mut [f64], were: bool) -> bool {
    let Some(matrix) = matrix else { return were };
    for point in points.as_chunks_mut::<3>().0 {
        *point = matrix.transform_point3(DVec3::from(*point)).into();
    }
    were && points.iter().all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(operations: &[Operation], mut values: &[f64], point: [f64; 3]) -> [f64; 3] {
        let mut product = DAffine3::IDENTITY;
        for operation in operations {
            let (taken, rest) = values.split_at(operation.count());
            (product, values) = (product * operation.matrix(taken), rest);
        }
        product.transform_point3(DVec3::from(point)).to_array().map(|x| (1e9 * x).round() / 1e9)
    }

    #[test]
    fn operations_act_from_the_last_to_the_first() {
        let (scale, translate) = ([2.0, 3.0, 4.0], [10.0, 0.0, 0.0]);
        let (scaled, translated) = (Operation::Scale(0, 3), Operation::Translate(0, 3));
        assert_eq!(moved(&[translated, scaled], &[translate, scale].concat(), [1.0; 3]), [12.0, 3.0, 4.0]);
        assert_eq!(moved(&[scaled, translated], &[scale, translate].concat(), [1.0; 3]), [22.0, 3.0, 4.0]);
        assert_eq!(moved(&[Operation::Turn], &[0.0, 0.0, 2.0, 90.0], [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
        assert_eq!(moved(&[Operation::Rotate(&[0])], &[90.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
        assert_eq!(moved(&[Operation::Rotate(&[1])], &[90.0], [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]);
        let rows: Vec<f64> = (0..16).map(f64::from).collect();
        assert_eq!(moved(&[Operation::Matrix], &rows, [1.0, 0.0, 0.0]), [12.0, 14.0, 16.0]);
    }

    #[test]
    fn rotations_keep_their_size_on_the_way() {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, -2.0, 0.5).normalize()] {
            for degrees in [0.0_f64, 10.0, 90.0, 172.0] {
                let of = |share: f64| {
                    let turn = DQuat::from_axis_angle(axis, (share * degrees).to_radians());
                    let turn = DQuat::from_rotation_y(200_f64.to_radians()) * turn;
                    DAffine3::from_scale_rotation_translation(DVec3::splat(2.0 + share), turn, DVec3::Z * share)
                };
                let columns = |share: f64| glam::DMat4::from(of(share)).to_cols_array();
                let found = Operation::Rigid.between(&columns(0.0), &columns(1.0), 0.25);
                assert!(found.abs_diff_eq(of(0.25), 1e-12), "{axis} {degrees}");
            }
        }
        // What mirrors goes in a line.
        let [still, mirrored] = [1.0, -1.0].map(|x| glam::DMat4::from_scale(DVec3::new(x, 1.0, 1.0)).to_cols_array());
        assert_eq!(Operation::Rigid.between(&still, &mirrored, 0.5).matrix3.x_axis.x, 0.0);
    }
}
