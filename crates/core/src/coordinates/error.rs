/// Why coordinates cannot be computed. Points ascend; the distance is over the cage's diagonal.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum CoordinatesError {
    #[error("{} outside the cage ({}), by up to {:.2} % of its diagonal, where {system} coordinates do not exist; enlarge the cage or use mean value coordinates (mvc)", counted(.points), listed(.points), 100.0 * .distance)]
    Outside { system: &'static str, points: Vec<u32>, distance: f64 },
    /// A factorisation failed, or refinement did not reach the accuracy.
    #[error("{system} coordinates could not be computed for this cage: {reason}; use mean value coordinates (mvc)")]
    NotComputed { system: &'static str, reason: String },
    /// A plan of boundary elements that is not one of this cage.
    #[error("the boundary elements of {system} coordinates do not fit the cage: {reason}; get the file again")]
    BadPlan { system: &'static str, reason: &'static str },
    /// Only mean value coordinates are computed by component.
    #[error(
        "{system} coordinates are not for a cage of components that carry a part of the model each; use mean value coordinates (mvc), or one cage for all parts"
    )]
    ByComponent { system: &'static str },
    /// Another model than the components of the cage are for.
    #[error(
        "the components of the cage carry {carried} points, the model has {points}; give the cage of a take of this model"
    )]
    Carried { carried: u32, points: usize },
}

fn counted(points: &[u32]) -> String {
    match points.len() {
        1 => "1 point lies".to_owned(),
        count => format!("{count} points lie"),
    }
}

/// The first of them.
fn listed(points: &[u32]) -> String {
    const SHOWN: usize = 8;
    let mut text = points.iter().take(SHOWN).map(u32::to_string).collect::<Vec<_>>().join(", ");
    if points.len() > SHOWN {
        text += ", …";
    }
    text
}
