//! What comes first: the capture, the advice, and the paper's claims.

use super::parts::{Html, Table, percent};
use crate::compare::figures::{Choice, Figures, Smoothness, Verdict};
use crate::plot::{escaped, grouped};

/// Title, facts and advice.
pub(super) fn head(figures: &Figures) -> String {
    let capture = &figures.capture;
    let sampled = match capture.measured.len() {
        all if all == capture.frames => format!("{} frames", grouped(all)),
        some => format!("{} frames ({some} of them, evenly spaced, are measured)", grouped(capture.frames)),
    };
    let model = match capture.triangles {
        0 => format!("a cloud of {} points", grouped(capture.points)),
        triangles => format!("{} points and {} triangles", grouped(capture.points), grouped(triangles)),
    };
    let mut text = format!(
        "<h1>Ways to invert this capture, compared</h1>\n<p class=\"lead\">{source}: {sampled} of {model}; cage {cage} of {} vertices and {} faces. Lengths are percentages of the diagonal of the rest pose's bounding box ({:.4} in the capture's unit).</p>\n",
        grouped(capture.cage_vertices),
        grouped(capture.cage_faces),
        capture.diagonal,
        source = escaped(&capture.source),
        cage = escaped(&capture.cage),
    );
    let advice = &figures.recommendation;
    text.push_str("<div class=\"cards\">\n");
    let bound = format!("{:.0} %", 100.0 * (advice.accurate - 1.0));
    if let Some(choice) = &advice.editing {
        let why = format!(
            "The smoothest cages among the methods whose mean L2 is at most {bound} above the lowest of the same coordinates: mean L2 {} %, and {}.",
            percent(choice.l2_mean, 3),
            smoothness(choice)
        );
        text.push_str(&card("For cages that people or programs work with", choice, &why, figures));
    }
    if let Some(choice) = &advice.accuracy {
        let why = format!(
            "The lowest mean L2 of all methods here: {} %; {}.",
            percent(choice.l2_mean, 3),
            smoothness(choice)
        );
        text.push_str(&card("For the lowest error", choice, &why, figures));
    }
    text.push_str("</div>\n");
    if capture.motion_mean.is_finite() {
        text.push_str(&format!(
            "<p>The model's own points have a mean second difference of {} %: cages far above it shake where the model does not.</p>\n",
            percent(capture.motion_mean, 4)
        ));
    }
    text
}

fn smoothness(choice: &Choice) -> String {
    let value = percent(choice.smoothness, 4);
    match choice.smoothness_of {
        Smoothness::SecondDifference => format!("a cage vertex's mean second difference in time is {value} %"),
        Smoothness::Edges => format!(
            "a cage edge's length changes by {value} % of the mean length of the rest cage's edges on average (no three frames that follow each other were measured, so nothing is known of time)"
        ),
    }
}

fn card(title: &str, choice: &Choice, why: &str, figures: &Figures) -> String {
    let capture = &figures.capture;
    let command = format!(
        "cager encode --rest {} \\\n  --cage {}{} \\\n  --frames {} \\\n  {} \\\n  -o out.cager",
        quoted(&capture.rest),
        quoted(&capture.cage),
        if capture.flip_cage { " --flip-cage" } else { "" },
        quoted(&capture.source),
        choice.flags
    );
    format!(
        "<div class=\"card\"><h3>{}</h3><div class=\"big\">{}: {}</div><p>{}</p><pre><code>{}</code></pre></div>\n",
        escaped(title),
        escaped(&choice.system),
        escaped(&choice.method),
        escaped(why),
        command.lines().map(escaped).collect::<Vec<_>>().join("\n")
    )
}

/// As a shell takes it for one word.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:@%+=,".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// The paper's claims on this capture.
pub(super) fn claims(html: &mut Html, figures: &Figures) {
    html.section("claims", "What the paper says, and what this capture says");
    let mut table = Table::new(&["", "system", "claim", "where", "measured here"], 5).with_paragraphs(&[2, 4]);
    for claim in &figures.claims {
        let (class, word) = match claim.verdict {
            Verdict::Holds => ("holds", "holds"),
            Verdict::InPart => ("in-part", "in part"),
            Verdict::Fails => ("fails", "does not hold"),
        };
        table.row(vec![
            format!("<span class=\"{class}\">{word}</span>"),
            escaped(&claim.system),
            escaped(claim.statement),
            escaped(claim.source),
            escaped(&claim.measured),
        ]);
    }
    html.table(&table);
    html.paragraph("Verdicts are computed: differences below 2 % do not count, and a claim with two halves of which one holds does so in part. The paper's own figures are of cages made by artists; what an automatic cage changes is in <code>docs/PAPER.md</code> of the project.");
}

/// Systems that cannot be used with this cage.
pub(super) fn refused(html: &mut Html, figures: &Figures) {
    let refused: Vec<(&str, &str)> =
        figures.systems.iter().filter_map(|s| Some((s.name.as_str(), s.refused.as_deref()?))).collect();
    if refused.is_empty() {
        return;
    }
    html.section("refused", "Coordinate systems that this cage does not allow");
    for (name, reason) in refused {
        html.paragraph(&format!("<span class=\"note\"><b>{}</b>: {}.</span>", escaped(name), escaped(reason)));
    }
}

/// What comes last.
pub(super) fn foot(figures: &Figures) -> String {
    format!(
        "<footer>Written by <code>cager compare</code> {}. For the same inputs it writes the same figures; times differ. The paper: Thiery, Tierny and Boubekeur, <i>CageR: Cage-based Reverse Engineering of Animated 3D Shapes</i>, Computer Graphics Forum 31 (8), 2012.</footer>\n",
        escaped(figures.program)
    )
}

#[cfg(test)]
mod tests {
    #[test]
    fn words_survive_a_shell() {
        assert_eq!(super::quoted("walk/rest.obj"), "walk/rest.obj");
        assert_eq!(super::quoted("walk/*.obj"), "'walk/*.obj'");
        assert_eq!(super::quoted("it's"), r"'it'\''s'");
    }
}
