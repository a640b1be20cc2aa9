//! Findings as messages that say what to do.

use super::Findings;
use cager_geometry::spatial::intersect::MAX_PAIRS;
use std::fmt;

impl Findings {
    /// One sentence for each thing that is wrong, with what to do about it.
    pub fn messages(&self) -> Vec<String> {
        let (f, d) = (self, &self.defects);
        let at_least = if f.self_intersections.len() < MAX_PAIRS { "" } else { "at least " };
        let condition = f.condition_number.filter(|c| *c > ILL_CONDITIONED).map(|condition| {
            if condition.is_finite() {
                format!("ill-conditioned (condition number {condition:.1e})")
            } else {
                "singular".to_owned()
            }
        });
        let said = [
            (f.faces == 0)
                .then(|| "no faces, where a cage is a closed surface; export it as a mesh with its faces".to_owned()),
            listed("vertex", one(&d.not_finite), "with coordinates that are NaN or infinite (…); delete them or export the cage again"),
            listed("face", one(&d.dangling_faces), "naming vertices that do not exist (…); export the cage again"),
            listed("face", one(&d.degenerate_faces), "without area (…); delete them or merge their vertices"),
            listed("pair", two(&d.duplicate_faces), "of faces over the same vertices (…); delete one of each"),
            listed("pair", two(&f.duplicate_vertices), "of vertices in the same place (…); merge them"),
            listed("pair", two(&f.touching_vertices), "of vertices in the same place, at which parts of the surface only touch (…); move them apart"),
            listed("vertex", one(&d.loose_vertices), "that no face uses (…); delete loose vertices"),
            listed("edge", two(&d.open_edges), "with a face on one side only (…); fill the holes or merge doubled vertices")
            .map(|open| format!("the cage is open: {open}")),
            listed("edge", two(&d.non_manifold_edges), "shared by more than two faces (…); separate or delete the extra faces"),
            listed("vertex", one(&f.non_manifold_vertices), "at which parts of the surface only touch (…); split them"),
            listed("edge", two(&d.inconsistent_edges), "between faces that wind in opposite directions (…); recalculate the cage's normals"),
            (!d.inward_parts.is_empty()).then(|| {
                format!("{} of {} pointing inwards; flip them", counted(d.inward_parts.len(), "part"), d.components)
            }),
            listed("pair", two(&f.self_intersections), "of faces that cut or touch one another (…); move their vertices apart")
            .map(|pairs| format!("{at_least}{pairs}")),
            f.outside.map(|o| {
                format!(
                    "{} of {} points outside the cage, the farthest, point {}, by {:.3} % of the diagonal; enlarge the cage there",
                    o.count,
                    o.points,
                    o.farthest,
                    100.0 * o.distance
                )
            }),
            (f.usable() && !f.enclosure_examined).then(|| {
                "whether the cage encloses the model is unknown, as the model has no points or some that are not finite; export it again"
                    .to_owned()
            }),
            f.alignment.map(|alignment| alignment.to_string()),
            listed("vertex", one(&f.idle_vertices), "that moves no point of the model (…); delete it or bring the cage closer there"),
            condition.map(|how| {
                format!(
                    "the coordinates are {how}, so that handles are hard to solve for; use fewer vertices where the model is small, or bring the cage closer"
                )
            }),
        ];
        said.into_iter().flatten().collect()
    }
}

/// How many there are, what is wrong with them, the first few in the place of `…`, and a cure.
fn listed(noun: &str, (count, shown): (usize, String), text: &str) -> Option<String> {
    let dots = if count > SHOWN { ", …" } else { "" };
    (count > 0).then(|| format!("{} {}", counted(count, noun), text.replace('…', &(shown + dots))))
}

/// Items that a sentence lists.
const SHOWN: usize = 6;

fn one(items: &[u32]) -> (usize, String) {
    named(items, u32::to_string)
}

fn two(items: &[[u32; 2]]) -> (usize, String) {
    named(items, |[a, b]| format!("{a}–{b}"))
}

fn named<T>(items: &[T], name: impl Fn(&T) -> String) -> (usize, String) {
    (items.len(), items.iter().take(SHOWN).map(name).collect::<Vec<_>>().join(", "))
}

pub(super) fn counted(items: usize, noun: &str) -> String {
    match (items, noun) {
        (1, _) => format!("1 {noun}"),
        (_, "vertex") => format!("{items} vertices"),
        (_, _) => format!("{items} {noun}s"),
    }
}

/// A condition number above which the solver's regularisation has to give up part of the cage.
const ILL_CONDITIONED: f64 = 1e5;

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match (self.usable(), self.editable()) {
            (false, _) => "not usable",
            (true, false) => "usable for encoding, but not fit to be edited",
            (true, true) => "usable, and fit to be edited",
        };
        write!(
            f,
            "{} vertices, {} faces, {} components: {verdict}",
            self.vertices, self.faces, self.defects.components
        )?;
        self.messages().iter().try_for_each(|s| write!(f, "\n{s}"))
    }
}
