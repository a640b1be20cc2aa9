//! Transforms above a mesh: a stack of operations, of which each is an attribute.

use super::layer::Layer;
use crate::error::Fault;
use crate::scene::{Chain, Failure, MOST_OPERATIONS, Operation, ancestry, shown};

/// What the order of operations has in front of what is undone, and in place of all that is above a prim.
const INVERTED: &str = "!invert!";
const RESET: &str = "!resetXformStack!";

fn operation(name: &str) -> Option<Operation> {
    Some(match name {
        "translate" => Operation::Translate(0, 3),
        "translateX" => Operation::Translate(0, 1),
        "translateY" => Operation::Translate(1, 1),
        "translateZ" => Operation::Translate(2, 1),
        "scale" => Operation::Scale(0, 3),
        "scaleX" => Operation::Scale(0, 1),
        "scaleY" => Operation::Scale(1, 1),
        "scaleZ" => Operation::Scale(2, 1),
        "rotateX" => Operation::Rotate(&[0]),
        "rotateY" => Operation::Rotate(&[1]),
        "rotateZ" => Operation::Rotate(&[2]),
        "rotateXYZ" => Operation::Rotate(&[0, 1, 2]),
        "rotateXZY" => Operation::Rotate(&[0, 2, 1]),
        "rotateYXZ" => Operation::Rotate(&[1, 0, 2]),
        "rotateYZX" => Operation::Rotate(&[1, 2, 0]),
        "rotateZXY" => Operation::Rotate(&[2, 0, 1]),
        "rotateZYX" => Operation::Rotate(&[2, 1, 0]),
        "orient" => Operation::Orient,
        "transform" => Operation::Matrix,
        _ => return None,
    })
}

/// The transforms above a mesh and of the mesh itself, up to one that does not inherit what is above it.
pub(super) fn above<'a>(layer: &mut (dyn Layer + 'a), mesh: usize) -> Result<Chain, Failure> {
    let mut chain = Chain::default();
    for prim in ancestry(layer.nodes(), mesh).collect::<Vec<_>>() {
        let Some(order) = layer.attribute(prim, "xformOpOrder")?.still() else { continue };
        let names = layer.tokens(order, MOST_OPERATIONS)?;
        let reset = names.iter().rposition(|name| name == RESET);
        for name in names[reset.map_or(0, |place| place + 1)..].iter().rev() {
            let plain = name.strip_prefix(INVERTED).unwrap_or(name);
            let told = plain.strip_prefix("xformOp:").and_then(|told| operation(told.split(':').next()?));
            let Some(operation) = told else {
                let what = format!("has a transform of an unknown kind, {}; bake it into the points", shown(name));
                return Err(Fault::unsupported(what).into());
            };
            let values = layer.attribute(prim, plain)?;
            if !values.is_empty() {
                chain.push(layer, values, vec![operation], plain.len() < name.len())?;
            }
        }
        if reset.is_some() {
            break;
        }
    }
    Ok(chain)
}
