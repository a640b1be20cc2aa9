//! The commands, options, messages and claims of the README and the documents: what can be run is run, the rest is looked up.

use crate::support::{FRAMES, cager, repository, succeeds, text, write_capture};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

const README: &str = "README.md";
const GUIDE: &str = "docs/GUIDE.md";
/// Whose commands and options must be those of the program.
const DOCUMENTS: [&str; 8] = [
    README,
    GUIDE,
    "docs/CLIENTS.md",
    "docs/EXPLORATION.md",
    "docs/FARM.md",
    "docs/OPERATIONS.md",
    "docs/RECOVERY.md",
    "docs/VIEWER.md",
];

/// The lines in fenced blocks that call the program, as words without quotes and comments.
fn commands(text: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let mut within = false;
    for line in text.replace("\\\n", " ").lines() {
        if line.starts_with("```") {
            within = !within;
        } else if within && line.starts_with("cager ") {
            let words = line.split_whitespace().take_while(|&word| word != "#");
            found.push(words.map(|word| word.replace(['\'', '"'], "")).collect());
        }
    }
    found
}

/// Options that the help of a command names.
fn options(command: &str) -> BTreeSet<String> {
    let shown = succeeds(cager().args([command, "--help"]));
    options_in(&String::from_utf8(shown.stdout).expect("UTF-8"))
}

fn options_in(text: &str) -> BTreeSet<String> {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '-');
    words.filter(|word| word.starts_with("--") && word.len() > 3).map(str::to_owned).collect()
}

#[test]
fn every_command_and_option_of_the_documents_is_one_of_the_program() {
    let mut known: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for document in DOCUMENTS {
        for words in commands(&text(document)) {
            let name = words[1].clone();
            let known = known.entry(name.clone()).or_insert_with(|| options(&name));
            let unknown: Vec<_> =
                options_in(&words.join(" ")).into_iter().filter(|option| !known.contains(option)).collect();
            assert!(unknown.is_empty(), "{document}: {}: {unknown:?}", words.join(" "));
        }
    }
    assert!(known.len() > 10, "{:?}", known.keys());
    // Options that stand in a sentence or a table belong to some command.
    let all: BTreeSet<String> = known.into_values().flatten().collect();
    for document in [README, GUIDE] {
        let text = text(document);
        for code in text.split('`').skip(1).step_by(2).filter(|code| code.starts_with("--")) {
            let unknown: Vec<_> = options_in(code).into_iter().filter(|option| !all.contains(option)).collect();
            assert!(unknown.is_empty(), "{document}: `{code}`: {unknown:?}");
        }
    }
}

/// The commands of the first block below a heading.
fn section(document: &str, heading: &str) -> Vec<Vec<String>> {
    let text = text(document);
    let below = text.split(&format!("\n## {heading}\n")).nth(1).unwrap_or_else(|| panic!("{document}: {heading}"));
    let block = below.split("```sh\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a block");
    commands(&format!("```\n{block}```\n"))
}

/// `rest.obj` and `walk.npy` of 25 frames, as the examples want them.
fn write_walk(folder: &Path) {
    write_capture(folder);
    let once = fs::read(folder.join("frames.f32")).expect("frames");
    let points = once.len() / 12 / FRAMES;
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {points}, 3), }}", 5 * FRAMES);
    let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    npy.extend(format!("{header:<117}\n").bytes());
    npy.extend(once.repeat(5));
    fs::write(folder.join("walk.npy"), npy).expect("walk.npy");
}

/// Runs commands in a folder and returns what they said.
fn run(folder: &Path, lines: Vec<Vec<String>>) -> String {
    let mut said = String::new();
    for words in lines {
        let mut command = cager();
        command.current_dir(folder).args(&words[1..]);
        if words[1] == "encode" {
            // Without them a design takes minutes.
            command.args(["--time-limit", "1", "--cage-vertices", "40"]);
        }
        let done = succeeds(&mut command);
        said += &String::from_utf8_lossy(&done.stdout);
        said += &String::from_utf8_lossy(&done.stderr);
    }
    said
}

#[test]
fn the_commands_of_readme_and_guide_encode_decode_and_edit() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write_walk(folder);
    let own = section(README, "Your own capture");
    assert_eq!(own.len(), 2, "{own:?}");
    let said = run(folder, own);
    let shown = text(README);
    let shown = shown.split("```text\n").nth(1).and_then(|rest| rest.split("```").next()).expect("an output");
    for line in shown.lines().filter(|line| line.starts_with("  ") || line.starts_with("walk.")) {
        let label = line.split_whitespace().next().expect("a label");
        assert!(said.lines().any(|line| line.split_whitespace().next() == Some(label)), "{label} is missing: {said}");
    }

    fs::copy(folder.join("rest.obj"), folder.join("coat.obj")).expect("a copy");
    let edited = section(GUIDE, "Edited cages, other models, some frames");
    assert_eq!(edited.len(), 6, "{edited:?}");
    let (cages, rest) = edited.split_at(1);
    run(folder, cages.to_vec());
    let mut moved = fs::read(folder.join("cages.npy")).expect("cages");
    let last = moved.len() - 4;
    moved[last..].copy_from_slice(&0.5_f32.to_le_bytes());
    fs::write(folder.join("edited.npy"), moved).expect("cages");
    run(folder, rest.to_vec());
    for file in ["cages.cage.obj", "edited.pc2", "edited.cager", "walk-again.cager", "coat.pc2", "out/walk.0020.obj"] {
        assert!(folder.join(file).exists(), "{file}");
    }
}

#[test]
fn every_claim_of_the_readme_is_measured_in_the_document_beside_it() {
    let readme = text(README);
    let makefile = text("Makefile");
    let measured =
        readme.split("\n## Measured\n").nth(1).and_then(|rest| rest.split("\n## ").next()).expect("a section");
    let rows: Vec<Vec<&str>> = measured
        .lines()
        .skip_while(|line| !line.starts_with("|---"))
        .skip(1)
        .take_while(|l| l.starts_with('|'))
        .map(|l| l.split('|').collect())
        .collect();
    assert!(rows.len() > 5, "{measured}");
    for row in rows {
        let command = row[3].trim().trim_matches('`').strip_prefix("make ").expect("a command");
        assert!(makefile.contains(&format!("\n{command}:")), "make {command}");
        let link = row[4].split("](").nth(1).and_then(|rest| rest.split(')').next()).expect("a document");
        let document = text(link);
        let figures: Vec<&str> =
            row[1].split("**").skip(1).step_by(2).chain(row[2].split("**").skip(1).step_by(2)).collect();
        assert!(!figures.is_empty(), "{row:?}");
        for figure in figures {
            let there = document.match_indices(figure).any(|(at, _)| {
                let digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit() || c == '.');
                !digit(document[..at].chars().next_back())
                    && !document[at + figure.len()..].starts_with(|c: char| c.is_ascii_digit())
            });
            assert!(there, "{figure} is not in {link}");
        }
    }
}

#[test]
fn every_message_of_the_guide_is_one_of_the_sources() {
    let guide = text(GUIDE);
    let errors = guide.split("\n## Errors\n").nth(1).and_then(|rest| rest.split("\n## ").next()).expect("a section");
    let mut sources = String::new();
    let mut folders = ["src", "crates", "proto"].map(|folder| repository().join(folder)).to_vec();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                sources += &fs::read_to_string(&path).expect("a source");
            }
        }
    }
    let rows: Vec<&str> = errors.lines().filter(|line| line.contains('`') && line.starts_with('|')).collect();
    assert!(rows.len() > 15, "{errors}");
    // Names and numbers are put into the words of the sources: both are compared without them.
    let mut plain = String::new();
    for part in sources.split('{') {
        plain += part.split_once('}').map_or(part, |(_, after)| after);
        plain.push('0');
    }
    let plain = plain.split_whitespace().collect::<Vec<_>>().join(" ");
    for row in rows {
        let message = row.split('`').nth(1).expect("a message");
        let number = |word: &&str| word.contains(|c: char| c.is_ascii_digit());
        let words: Vec<&str> = message.split_whitespace().map(|word| if number(&word) { "0" } else { word }).collect();
        let found = words.windows(4.min(words.len())).any(|words| plain.contains(&words.join(" ")));
        assert!(found, "{message}");
    }
}
