//! Transforms above a mesh: a stack of operations, of which each is an attribute.

use super::layer::{Instance, Layer};
use crate::error::Fault;
use crate::scene::{Chain, MOST_OPERATIONS, Operation, ancestry, shown};

/// In the order of operations: before what is undone, and in place of all that is above a prim.
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

/// The transforms of a mesh and above it, up to one that does not inherit what is above it.
pub(super) fn above(layer: &mut Layer<'_>, mesh: usize) -> Result<Chain, Fault> {
    let mut chain = Chain::default();
    for prim in ancestry(&layer.nodes, mesh).collect::<Vec<_>>() {
        if let Some(&Instance { instancer, index, .. }) = layer.instances.get(&prim) {
            let has_single = !layer.attribute(instancer, "orientationsf")?.is_empty();
            let turns = if has_single { "orientationsf" } else { "orientations" };
            for (name, operation) in [
                ("scales", Operation::Scale(0, 3)),
                (turns, Operation::Orient),
                ("positions", Operation::Translate(0, 3)),
            ] {
                let values = layer.source.element(instancer, name, operation.count(), index)?;
                if !values.is_empty() {
                    chain.push(layer.source.as_mut(), values, vec![operation], false)?;
                }
            }
        }
        let Some(names) = layer.tokens(prim, "xformOpOrder", MOST_OPERATIONS)? else { continue };
        let reset = names.iter().rposition(|name| name == RESET);
        for name in names[reset.map_or(0, |place| place + 1)..].iter().rev() {
            let plain = name.strip_prefix(INVERTED).unwrap_or(name);
            let told = plain.strip_prefix("xformOp:").and_then(|told| operation(told.split(':').next()?));
            let Some(operation) = told else {
                let what = format!("has a transform of an unknown kind, {}; bake it into the points", shown(name));
                return Err(Fault::unsupported(what));
            };
            let values = layer.attribute(prim, plain)?;
            if !values.is_empty() {
                chain.push(layer.source.as_mut(), values, vec![operation], plain.len() < name.len())?;
            }
        }
        if reset.is_some() {
            break;
        }
    }
    Ok(chain)
}
