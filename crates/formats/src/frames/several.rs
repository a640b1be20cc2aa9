//! What is said of files that are not one sequence, and patterns that pick one.

use std::path::Path;

use super::pieces::Name;

/// Sequences that a message lists.
const LISTED: usize = 4;

/// What was found in place of one sequence, and how to pick one.
pub(super) fn several(folder: &Path, names: &[Name<'_>], groups: &[Vec<&Name<'_>>]) -> String {
    let (mut words, mut patterns) = (Vec::new(), Vec::new());
    for files in groups.iter().take(LISTED) {
        let pattern = pattern(names, files);
        let like = pattern.clone().unwrap_or_else(|| files[0].to_string());
        words.push(if files.len() > 1 { format!("{} like {like}", files.len()) } else { files[0].to_string() });
        if files.len() > 1 {
            patterns.extend(pattern.map(|pattern| format!("'{}'", folder.join(pattern).display())));
        }
    }
    if groups.len() > LISTED {
        words.push("more".to_owned());
    }
    patterns.truncate(2);
    let cure = match patterns.as_slice() {
        [] => "move the others elsewhere, or pick one with a pattern".to_owned(),
        patterns => format!("pick one with a pattern such as {}", patterns.join(" or ")),
    };
    let numbers: Vec<Vec<&str>> = names.iter().map(Name::values).collect();
    let twin = (0..names.len())
        .flat_map(|a| (a + 1..names.len().min(a + 64)).map(move |b| (a, b)))
        .find(|&(a, b)| !numbers[a].is_empty() && numbers[a] == numbers[b] && names[a].texts() == names[b].texts());
    let twins = twin
        .map_or_else(String::new, |(a, b)| format!(", and {} and {} have the same frame number", names[a], names[b]));
    format!("holds files of several sequences or versions: {}{twins}; {cure}", words.join(", "))
}

/// The shortest pattern that matches these files and none of the others.
fn pattern(names: &[Name<'_>], files: &[&Name<'_>]) -> Option<String> {
    let first = files.first()?;
    let with = |place: fn(usize) -> Option<String>| {
        let mut pattern = String::new();
        for (k, piece) in first.pieces.iter().enumerate() {
            let others = || files.iter().map(|name| name.pieces[k]);
            let is_text = k % 2 == 0 || others().all(|other| other == *piece);
            let digits = if others().all(|other| other.len() == piece.len()) { piece.len() } else { 0 };
            pattern += &if is_text { glob::Pattern::escape(piece) } else { place(digits)? };
        }
        Some(pattern + first.extension)
    };
    let stars = with(|_| Some("*".to_owned()));
    let digits = with(|count| (count > 0).then(|| "?".repeat(count)));
    let options = glob::MatchOptions { require_literal_separator: true, ..Default::default() };
    let picks = |pattern: &glob::Pattern| {
        let matches = |name: &Name<'_>| pattern.matches_with(&name.to_string(), options);
        names.iter().all(|name| matches(name) == files.iter().any(|file| std::ptr::eq(*file, name)))
    };
    stars.into_iter().chain(digits).find(|text| glob::Pattern::new(text).is_ok_and(|pattern| picks(&pattern)))
}
