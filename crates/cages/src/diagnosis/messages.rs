//! Findings as messages that say what to do.

use super::Findings;
use crate::geometry::intersect::MOST_PAIRS;
use std::fmt;

impl Findings {
    /// One sentence for each thing that is wrong, with what to do about it; empty for a faultless cage.
    pub fn messages(&self) -> Vec<String> {
        let mut said = Vec::new();
        let mut say = |wrong: usize, sentence: String| {
            if wrong > 0 {
                said.push(sentence);
            }
        };
        let list = |shown: Vec<String>, of: usize| {
            let dots = if of > shown.len() { ", …" } else { "" };
            format!("{}{dots}", shown.join(", "))
        };
        let one = |items: &[u32]| list(items.iter().take(6).map(u32::to_string).collect(), items.len());
        let two =
            |items: &[[u32; 2]]| list(items.iter().take(6).map(|[a, b]| format!("{a}–{b}")).collect(), items.len());
        let n = |items: usize, what: &str| match (items, what) {
            (1, _) => format!("1 {what}"),
            (_, "vertex") => format!("{items} vertices"),
            (_, _) => format!("{items} {what}s"),
        };
        let f = self;
        say(
            usize::from(f.faces == 0),
            "no faces, where a cage is a closed surface; export it as a mesh with its faces".to_owned(),
        );
        say(
            f.not_finite.len(),
            format!(
                "{} with coordinates that are NaN or infinite ({}); delete them or export the cage again",
                n(f.not_finite.len(), "vertex"),
                one(&f.not_finite)
            ),
        );
        say(
            f.dangling_faces.len(),
            format!(
                "{} naming vertices that do not exist ({}); export the cage again",
                n(f.dangling_faces.len(), "face"),
                one(&f.dangling_faces)
            ),
        );
        say(
            f.degenerate_faces.len(),
            format!(
                "{} without area ({}); delete them or merge their vertices",
                n(f.degenerate_faces.len(), "face"),
                one(&f.degenerate_faces)
            ),
        );
        say(
            f.duplicate_faces.len(),
            format!(
                "{} of faces over the same vertices ({}); delete one of each",
                n(f.duplicate_faces.len(), "pair"),
                two(&f.duplicate_faces)
            ),
        );
        say(
            f.duplicate_vertices.len(),
            format!(
                "{} of vertices in the same place ({}); merge them",
                n(f.duplicate_vertices.len(), "pair"),
                two(&f.duplicate_vertices)
            ),
        );
        say(
            f.loose_vertices.len(),
            format!(
                "{} that no face uses ({}); delete loose vertices",
                n(f.loose_vertices.len(), "vertex"),
                one(&f.loose_vertices)
            ),
        );
        say(
            f.open_edges.len(),
            format!(
                "the cage is open: {} with a face on one side only ({}); fill the holes or merge doubled vertices",
                n(f.open_edges.len(), "edge"),
                two(&f.open_edges)
            ),
        );
        say(
            f.non_manifold_edges.len(),
            format!(
                "{} shared by more than two faces ({}); separate or delete the extra faces",
                n(f.non_manifold_edges.len(), "edge"),
                two(&f.non_manifold_edges)
            ),
        );
        say(
            f.non_manifold_vertices.len(),
            format!(
                "{} at which parts of the surface only touch ({}); split them",
                n(f.non_manifold_vertices.len(), "vertex"),
                one(&f.non_manifold_vertices)
            ),
        );
        say(
            f.inconsistent_edges.len(),
            format!(
                "{} between faces that wind in opposite directions ({}); recalculate the cage's normals",
                n(f.inconsistent_edges.len(), "edge"),
                two(&f.inconsistent_edges)
            ),
        );
        say(f.inward_parts, format!("{} of {} pointing inwards; flip them", n(f.inward_parts, "part"), f.components));
        say(
            f.self_intersections.len(),
            format!(
                "{}{} of faces that cut or touch one another ({}); move their vertices apart",
                if f.self_intersections.len() < MOST_PAIRS { "" } else { "at least " },
                n(f.self_intersections.len(), "pair"),
                two(&f.self_intersections)
            ),
        );
        if let Some(o) = f.outside {
            say(
                1,
                format!(
                    "{} of {} points outside the cage, the farthest, point {}, by {:.3} % of the diagonal; enlarge the cage there",
                    o.count,
                    o.points,
                    o.farthest,
                    100.0 * o.distance
                ),
            );
        }
        say(
            usize::from(f.usable() && !f.enclosure_examined),
            "whether the cage encloses the model is unknown, as the model has no points or some that are not finite; export it again"
                .to_owned(),
        );
        if let Some(alignment) = f.alignment {
            say(1, alignment.to_string());
        }
        say(
            f.idle_vertices.len(),
            format!(
                "{} that moves no point of the model ({}); delete it or bring the cage closer there",
                n(f.idle_vertices.len(), "vertex"),
                one(&f.idle_vertices)
            ),
        );
        if let Some(condition) = f.condition_number.filter(|c| *c > ILL_CONDITIONED) {
            let how = if condition.is_finite() {
                format!("ill-conditioned (condition number {condition:.1e})")
            } else {
                "singular".to_owned()
            };
            say(
                1,
                format!(
                    "the coordinates are {how}, so that handles are hard to solve for; use fewer vertices where the model is small, or bring the cage closer"
                ),
            );
        }
        said
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
        write!(f, "{} vertices, {} faces, {} components: {verdict}", self.vertices, self.faces, self.components)?;
        self.messages().iter().try_for_each(|s| write!(f, "\n{s}"))
    }
}
