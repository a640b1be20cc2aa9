//! Transforms above a mesh, still or animated: a stack of operations, of which each is an attribute.

use super::layer::{Attribute, Layer, damaged};
use crate::error::Fault;
use crate::scene::{Failure, IDENTITY, Matrix, Objects, inverse, multiply, rotation, rows_of, slerp};

/// Operations of a prim, and of all prims above a mesh, which are done for every frame; programs write a handful.
const MOST_OPERATIONS: usize = 256;
const MOST_ABOVE: usize = 1 << 12;

/// What the order of operations has in front of what is undone, and in place of all that is above a prim.
const INVERTED: &str = "!invert!";
const RESET: &str = "!resetXformStack!";

/// The transforms above a mesh, from the inside to the outside, without those that do nothing.
pub(super) struct Chain(Vec<Link>);

/// One transform: its operations, the last of which is done first.
struct Link {
    operations: Vec<Operation>,
    /// The matrix, where it does not change.
    fixed: Option<Matrix>,
}

struct Operation {
    kind: Kind,
    is_inverted: bool,
    values: Attribute,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Along so many axes from this one on.
    Translate(usize, usize),
    Scale(usize, usize),
    /// About these axes, the first one first.
    Rotate(&'static [usize]),
    Orient,
    Matrix,
}

impl Kind {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "translate" => Self::Translate(0, 3),
            "translateX" => Self::Translate(0, 1),
            "translateY" => Self::Translate(1, 1),
            "translateZ" => Self::Translate(2, 1),
            "scale" => Self::Scale(0, 3),
            "scaleX" => Self::Scale(0, 1),
            "scaleY" => Self::Scale(1, 1),
            "scaleZ" => Self::Scale(2, 1),
            "rotateX" => Self::Rotate(&[0]),
            "rotateY" => Self::Rotate(&[1]),
            "rotateZ" => Self::Rotate(&[2]),
            "rotateXYZ" => Self::Rotate(&[0, 1, 2]),
            "rotateXZY" => Self::Rotate(&[0, 2, 1]),
            "rotateYXZ" => Self::Rotate(&[1, 0, 2]),
            "rotateYZX" => Self::Rotate(&[1, 2, 0]),
            "rotateZXY" => Self::Rotate(&[2, 0, 1]),
            "rotateZYX" => Self::Rotate(&[2, 1, 0]),
            "orient" => Self::Orient,
            "transform" => Self::Matrix,
            _ => return None,
        })
    }

    fn count(self) -> usize {
        match self {
            Self::Translate(_, count) | Self::Scale(_, count) => count,
            Self::Rotate([_]) => 1,
            Self::Rotate(_) => 3,
            Self::Orient => 4,
            Self::Matrix => 16,
        }
    }

    /// The matrix of as many numbers as there are to be.
    fn matrix(self, values: &[f64]) -> Matrix {
        let mut matrix = IDENTITY;
        match self {
            Self::Translate(axis, count) => matrix[3][axis..axis + count].copy_from_slice(values),
            Self::Scale(axis, _) => values.iter().enumerate().for_each(|(k, &x)| matrix[axis + k][axis + k] = x),
            Self::Rotate(axes) => {
                for &axis in axes {
                    // Three angles are in the order of the axes, whatever is done first.
                    let degrees = values[if axes.len() == 1 { 0 } else { axis }];
                    let about = std::array::from_fn(|k| f64::from(u8::from(k == axis)));
                    matrix = multiply(&matrix, &rotation(about, degrees));
                }
            }
            Self::Orient => {
                // As OpenUSD has it: quaternions are not made to be of length 1.
                let rows = rows_of(std::array::from_fn(|k| values[k]));
                matrix.iter_mut().zip(rows).for_each(|(to, row)| to[..3].copy_from_slice(&row));
            }
            Self::Matrix => matrix.as_flattened_mut().copy_from_slice(values),
        }
        matrix
    }
}

impl Chain {
    /// The transforms above a mesh and of the mesh itself, up to one that does not inherit what is above it.
    pub(super) fn of<'a>(layer: &mut Box<dyn Layer + 'a>, mesh: u32) -> Result<Self, Failure> {
        let (mut links, mut count) = (Vec::new(), 0);
        for prim in layer.ancestry(mesh as usize).collect::<Vec<_>>() {
            let prim = prim as u32;
            let Some(order) = layer.attribute(prim, "xformOpOrder")?.still() else { continue };
            let names = layer.tokens(order, MOST_OPERATIONS)?;
            let reset = names.iter().rposition(|name| name == RESET);
            let mut operations = Vec::new();
            for name in &names[reset.map_or(0, |place| place + 1)..] {
                operations.extend(operation(layer.as_mut(), prim, name)?);
            }
            count += operations.len();
            if count > MOST_ABOVE {
                return Err(damaged("the transforms above a mesh have more operations than any program writes").into());
            }
            let mut link = Link { operations, fixed: None };
            if link.operations.iter().all(|operation| operation.values.times.len() < 2) {
                // A single sample holds at all times, whatever the default.
                link.fixed = Some(link.at(layer.as_mut(), 0.0)?);
            }
            links.extend(Some(link).filter(|link| link.fixed != Some(IDENTITY)));
            if reset.is_some() {
                break;
            }
        }
        Ok(Self(links))
    }

    /// The times of all that moves.
    pub(super) fn times(&self) -> impl Iterator<Item = f64> {
        let moving = self.0.iter().filter(|link| link.fixed.is_none());
        moving.flat_map(|link| &link.operations).flat_map(|operation| operation.values.times.iter().copied())
    }

    /// The product of all transforms at a time code; none for the identity.
    pub(super) fn matrix(&self, layer: &mut dyn Layer, time: f64) -> Result<Option<Matrix>, Failure> {
        let mut product: Option<Matrix> = None;
        for link in &self.0 {
            let matrix = match link.fixed {
                Some(fixed) => fixed,
                None => link.at(layer, time)?,
            };
            product = Some(product.map_or(matrix, |inner| multiply(&inner, &matrix)));
        }
        match product {
            Some(matrix) if !matrix.as_flattened().iter().all(|x| x.is_finite()) => {
                let what = "has a transform that is NaN or infinite, or undone where it cannot be; repair it or bake it into the points";
                Err(Fault::invalid(what).into())
            }
            product => Ok(product.filter(|matrix| *matrix != IDENTITY)),
        }
    }
}

/// An operation by its name in the order of operations; none that has no value.
fn operation(layer: &mut dyn Layer, prim: u32, name: &str) -> Result<Option<Operation>, Failure> {
    let plain = name.strip_prefix(INVERTED).unwrap_or(name);
    let kind = plain.strip_prefix("xformOp:").and_then(|told| Kind::of(told.split(':').next().unwrap_or_default()));
    let Some(kind) = kind else {
        let what =
            format!("has a transform of an unknown kind, {}; bake it into the points", crate::scene::shown(name));
        return Err(Fault::unsupported(what).into());
    };
    let values = layer.attribute(prim, plain)?;
    let is_inverted = plain.len() < name.len();
    Ok((!values.is_empty()).then_some(Operation { kind, is_inverted, values }))
}

impl Link {
    fn at(&self, layer: &mut dyn Layer, time: f64) -> Result<Matrix, Failure> {
        let mut product = IDENTITY;
        for operation in &self.operations {
            let Some((value, next, share)) = operation.values.at(time) else { continue };
            let mut values = operation.numbers(layer, value)?;
            if share > 0.0 {
                let next = operation.numbers(layer, next)?;
                values = match operation.kind {
                    Kind::Orient => {
                        let [from, to] = [&values, &next].map(|values| std::array::from_fn(|k| values[k]));
                        slerp(from, to, share).to_vec()
                    }
                    _ => values.iter().zip(next).map(|(value, next)| value + share * (next - value)).collect(),
                };
            }
            let matrix = operation.kind.matrix(&values);
            product = multiply(&if operation.is_inverted { inverse(&matrix) } else { matrix }, &product);
        }
        Ok(product)
    }
}

impl Operation {
    fn numbers(&self, layer: &mut dyn Layer, value: super::layer::Value) -> Result<Vec<f64>, Failure> {
        let values = layer.numbers(value)?;
        if values.len() != self.kind.count() {
            return Err(damaged("a transform has too few numbers, or too many").into());
        }
        Ok(values)
    }
}
