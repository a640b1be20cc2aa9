//! `--pairs`: vertices of source and target that correspond, from a text file.

use anyhow::{Context, Result, bail};
use cager_explore::transfer::VertexPair;
use std::path::Path;

/// A vertex of the source and one of the target on each line, counted from 0; `#` begins a comment.
pub(super) fn read_pairs(path: &Path, source_points: usize, target_points: usize) -> Result<Vec<VertexPair>> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let mut pairs = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let words: Vec<&str> =
            line.split('#').next().unwrap_or("").split([' ', '\t', ',']).filter(|word| !word.is_empty()).collect();
        let place = || format!("{}: line {}", path.display(), k + 1);
        let [source, target] = words[..] else {
            if words.is_empty() {
                continue;
            }
            bail!(
                "{}: a pair is a vertex of the source and one of the target, such as 12 345; write two numbers",
                place()
            );
        };
        let vertex = |word: &str, whose: &str, points: usize| {
            let Ok(vertex) = word.parse::<u32>() else {
                bail!("{}: {word:?} is no number of a vertex; vertices are counted from 0", place());
            };
            if vertex as usize >= points {
                bail!(
                    "{}: there is no vertex {vertex} in the {whose}, whose last one is {}; vertices are counted from 0",
                    place(),
                    points.saturating_sub(1)
                );
            }
            Ok(vertex)
        };
        pairs.push(VertexPair {
            source: vertex(source, "source", source_points)?,
            target: vertex(target, "target", target_points)?,
        });
    }
    if pairs.is_empty() {
        bail!("{}: has no pairs; write one on each line, or leave out --pairs", path.display());
    }
    Ok(pairs)
}
