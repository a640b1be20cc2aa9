//! What is said of files that are not one sequence, and patterns that pick one.

use super::pieces::{Names, Pieces};

/// Sequences that a message lists.
const LISTED: usize = 4;

/// What was found in place of one sequence, and how to pick one.
pub(super) fn several(names: &Names, pieces: &[Pieces<'_>], groups: &[Vec<usize>]) -> String {
    let mut words = Vec::new();
    let mut patterns = Vec::new();
    for files in groups.iter().take(LISTED) {
        let pattern = pattern(names, pieces, files);
        words.push(match (files.as_slice(), &pattern) {
            (&[only], _) => names.name(only),
            (_, Some(pattern)) => format!("{} like {pattern}", files.len()),
            (&[first, ..], None) => format!("{} like {}", files.len(), names.name(first)),
            ([], None) => continue,
        });
        if files.len() > 1 {
            patterns.extend(pattern.map(|pattern| format!("'{}'", names.folder.join(pattern).display())));
        }
    }
    if groups.len() > LISTED {
        words.push("more".to_owned());
    }
    let cure = match patterns.first() {
        Some(_) => format!("pick one with a pattern such as {}", patterns[..patterns.len().min(2)].join(" or ")),
        None => "move the others elsewhere, or pick one with a pattern".to_owned(),
    };
    let numbers: Vec<Vec<&str>> = pieces.iter().map(Pieces::values).collect();
    let twin = (0..pieces.len())
        .flat_map(|a| (a + 1..pieces.len().min(a + 64)).map(move |b| (a, b)))
        .find(|&(a, b)| !numbers[a].is_empty() && pieces[a].texts == pieces[b].texts && numbers[a] == numbers[b]);
    let twins = twin.map_or_else(String::new, |(a, b)| {
        format!(", and {} and {} have the same frame number", names.name(a), names.name(b))
    });
    format!("holds files of several sequences or versions: {}{twins}; {cure}", words.join(", "))
}

/// The shortest pattern that matches these files and none of the others.
fn pattern(names: &Names, pieces: &[Pieces<'_>], files: &[usize]) -> Option<String> {
    let first = *files.first()?;
    let of_group = &pieces[first];
    let same = |k: usize| files.iter().all(|&file| pieces[file].numbers.get(k) == of_group.numbers.get(k));
    let width = |k: usize| {
        files.iter().all(|&file| pieces[file].numbers.get(k).map(|n| n.len()) == Some(of_group.numbers[k].len()))
    };
    let with = |place: &dyn Fn(usize) -> Option<String>| {
        let (mut pattern, mut rest, mut k) = (String::new(), names.labels[first].as_str(), 0);
        while !rest.is_empty() {
            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            if end > 0 {
                pattern.push_str(&if same(k) { rest[..end].to_owned() } else { place(k)? });
                k += 1;
            }
            let next = rest[end..].find(|c: char| c.is_ascii_digit()).map_or(rest.len(), |at| end + at);
            pattern.push_str(&glob::Pattern::escape(&rest[end..next]));
            rest = &rest[next..];
        }
        Some(pattern + &names.extensions[first])
    };
    let digits = |k: usize| width(k).then(|| of_group.numbers[k].len());
    let candidates = [
        with(&|_| Some("*".to_owned())),
        with(&|k| digits(k).map(|count| "?".repeat(count))),
        with(&|k| digits(k).filter(|&count| count < 7).map(|count| "[0-9]".repeat(count))),
        with(&|_| Some("[0-9]*".to_owned())),
    ];
    let options = glob::MatchOptions { require_literal_separator: true, ..Default::default() };
    candidates.into_iter().flatten().find(|text| {
        glob::Pattern::new(text).is_ok_and(|pattern| {
            (0..pieces.len()).all(|file| pattern.matches_with(&names.name(file), options) == files.contains(&file))
        })
    })
}
