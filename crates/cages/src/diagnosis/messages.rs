//! Findings as messages that say what to do.

use super::Findings;
use cager_geometry::spatial::intersect::MAX_PAIRS;
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
        let (f, d) = (self, &self.defects);
        say(
            usize::from(f.faces == 0),
            "no faces, where a cage is a closed surface; export it as a mesh with its faces".to_owned(),
        );
        say(
            d.not_finite.len(),
            format!(
                "{} with coordinates that are NaN or infinite ({}); delete them or export the cage again",
                n(d.not_finite.len(), "vertex"),
                one(&d.not_finite)
            ),
        );
        say(
            d.dangling_faces.len(),
            format!(
                "{} naming vertices that do not exist ({}); export the cage again",
                n(d.dangling_faces.len(), "face"),
                one(&d.dangling_faces)
            ),
        );
        say(
            d.degenerate_faces.len(),
            format!(
                "{} without area ({}); delete them or merge their vertices",
                n(d.degenerate_faces.len(), "face"),
                one(&d.degenerate_faces)
            ),
        );
        say(
            d.duplicate_faces.len(),
            format!(
                "{} of faces over the same vertices ({}); delete one of each",
                n(d.duplicate_faces.len(), "pair"),
                two(&d.duplicate_faces)
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
            d.loose_vertices.len(),
            format!(
                "{} that no face uses ({}); delete loose vertices",
                n(d.loose_vertices.len(), "vertex"),
                one(&d.loose_vertices)
            ),
        );
        say(
            d.open_edges.len(),
            format!(
                "the cage is open: {} with a face on one side only ({}); fill the holes or merge doubled vertices",
                n(d.open_edges.len(), "edge"),
                two(&d.open_edges)
            ),
        );
        say(
            d.non_manifold_edges.len(),
            format!(
                "{} shared by more than two faces ({}); separate or delete the extra faces",
                n(d.non_manifold_edges.len(), "edge"),
                two(&d.non_manifold_edges)
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
            d.inconsistent_edges.len(),
            format!(
                "{} between faces that wind in opposite directions ({}); recalculate the cage's normals",
                n(d.inconsistent_edges.len(), "edge"),
                two(&d.inconsistent_edges)
            ),
        );
        say(
            d.inward_parts.len(),
            format!("{} of {} pointing inwards; flip them", n(d.inward_parts.len(), "part"), d.components),
        );
        say(
            f.self_intersections.len(),
            format!(
                "{}{} of faces that cut or touch one another ({}); move their vertices apart",
                if f.self_intersections.len() < MAX_PAIRS { "" } else { "at least " },
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
        write!(
            f,
            "{} vertices, {} faces, {} components: {verdict}",
            self.vertices, self.faces, self.defects.components
        )?;
        self.messages().iter().try_for_each(|s| write!(f, "\n{s}"))
    }
}
