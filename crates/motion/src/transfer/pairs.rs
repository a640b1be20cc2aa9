//! Vertices of source and target that correspond, as a text.

use cager_shape::transfer::VertexPair;

/// Most pairs: each takes a row of coordinates.
const MAX_PAIRS: usize = 10_000;

/// A vertex of the source and one of the target on each line, from 0; `#` begins a comment.
///
/// # Errors
/// What cannot be read, with its line, no pairs at all, or too many.
pub fn read_pairs(text: &str, [source_points, target_points]: [usize; 2]) -> Result<Vec<VertexPair>, String> {
    let mut pairs = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let words: Vec<&str> =
            line.split('#').next().unwrap_or("").split([' ', '\t', ',']).filter(|word| !word.is_empty()).collect();
        let line = k + 1;
        let [source, target] = words[..] else {
            if words.is_empty() {
                continue;
            }
            return Err(format!(
                "line {line}: a pair is a vertex of the source and one of the target, such as 12 345; write two numbers"
            ));
        };
        let vertex = |word: &str, whose: &str, points: usize| {
            let Ok(vertex) = word.parse::<u32>() else {
                return Err(format!("line {line}: {word:?} is no number of a vertex; vertices are counted from 0"));
            };
            if vertex as usize >= points {
                return Err(format!(
                    "line {line}: there is no vertex {vertex} in the {whose}, whose last one is {}; vertices are counted from 0",
                    points.saturating_sub(1)
                ));
            }
            Ok(vertex)
        };
        if pairs.len() == MAX_PAIRS {
            return Err(format!("line {line}: there are more than {MAX_PAIRS} pairs; a few dozen suffice"));
        }
        pairs.push(VertexPair {
            source: vertex(source, "source", source_points)?,
            target: vertex(target, "target", target_points)?,
        });
    }
    if pairs.is_empty() {
        return Err("has no pairs; write one on each line, or leave the pairs out".to_owned());
    }
    Ok(pairs)
}
