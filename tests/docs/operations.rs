//! `docs/OPERATIONS.md` names everything that operators meet, and nothing else.

use crate::support::{cager, metrics, repository, succeeds, text, words};
use std::collections::BTreeSet;
use std::fs;

const DOCUMENT: &str = "docs/OPERATIONS.md";

#[test]
fn every_kind_of_problem_is_in_the_table_with_its_status_and_title() {
    let document = text(DOCUMENT);
    for kind in cager_service::problem::ALL {
        let row = format!("| `{}` | {} | {} |", kind.word, kind.status.as_u16(), kind.title);
        assert!(document.contains(&row), "{row} is missing in {DOCUMENT}");
    }
}

#[test]
fn every_metric_is_in_the_table_and_described_and_no_other() {
    let (document, metrics) = (text(DOCUMENT), metrics());
    let described: String = text("crates/service/src/telemetry/metrics.rs").split_whitespace().collect();
    for metric in &metrics {
        assert!(document.contains(&format!("| `{metric}` |")), "{metric} is missing in {DOCUMENT}");
        assert!(described.contains(&format!("!(\"{metric}\",")), "{metric} is not described");
    }
    // Part of a module's name, by which a log is filtered.
    let crates = BTreeSet::from(["cager_service".to_owned()]);
    let unknown: BTreeSet<_> =
        words(&document).difference(&metrics).filter(|word| !crates.contains(*word)).cloned().collect();
    assert!(unknown.is_empty(), "{unknown:?} are in {DOCUMENT} but not in the sources");
}

#[test]
fn every_setting_is_in_the_table_with_its_default() {
    let document = text(DOCUMENT);
    let shown = succeeds(cager().args(["serve", "--check-config"]));
    let shown = String::from_utf8(shown.stdout).expect("UTF-8");
    assert!(shown.lines().count() > 25, "{shown}");
    for line in shown.lines() {
        let setting = line.split(" # default").next().unwrap_or_default().trim();
        let (key, value) = match setting.strip_prefix("# ") {
            Some(unset) => (unset.split(' ').next().unwrap_or_default(), "none"),
            None => setting.split_once(" = ").expect("key = value"),
        };
        let row = document.lines().find(|row| {
            let first = row.strip_prefix("| ").and_then(|row| row.split(" | ").next());
            first.is_some_and(|first| first.contains(&format!("`{key}`")))
        });
        let row = row.unwrap_or_else(|| panic!("{key} is missing in {DOCUMENT}"));
        let default = row.split(" | ").nth(1).unwrap_or_default().trim_matches('`');
        assert_eq!(default, value.trim_matches('"'), "default of {key}");
    }
}

#[test]
fn the_commands_for_tokens_make_a_file_that_is_accepted() {
    let document = text(DOCUMENT);
    let section = document.split("## Tokens").nth(1).expect("a section");
    let commands = section.split("```sh\n").nth(1).and_then(|rest| rest.split("```").next()).expect("commands");
    let folder = tempfile::tempdir().expect("a folder");
    // The only part that a machine may lack.
    let commands = commands.replace("$(openssl rand -hex 32)", "0123456789abcdef0123456789abcdef");
    succeeds(std::process::Command::new("sh").args(["-euc", &commands]).current_dir(folder.path()));
    let limits = cager_service::config::ServeConfig::default().tenant_limits();
    let access =
        cager_service::auth::Access::open(Some(&folder.path().join("tokens.toml")), limits).expect("a tokens file");
    let bearer = http::HeaderValue::from_static("Bearer 0123456789abcdef0123456789abcdef");
    let headers = http::HeaderMap::from_iter([(http::header::AUTHORIZATION, bearer)]);
    assert_eq!(access.authenticate(&headers).expect("a tenant").tenant.name, "studio-a");
}

#[test]
fn links_between_documents_lead_somewhere() {
    let mut documents = vec!["README.md".to_owned()];
    for entry in fs::read_dir(repository().join("docs")).expect("a folder") {
        let name = entry.expect("an entry").file_name().into_string().expect("UTF-8");
        if name.ends_with(".md") {
            documents.push(format!("docs/{name}"));
        }
    }
    assert!(documents.len() > 10, "{documents:?}");
    for document in documents {
        let folder = repository().join(&document);
        let folder = folder.parent().expect("a folder");
        for link in text(&document).split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            if link.contains("://") {
                continue;
            }
            // Without a file, a heading of the same document.
            let target = if file.is_empty() { repository().join(&document) } else { folder.join(file) };
            let target = fs::read(target).unwrap_or_else(|error| panic!("{document}: {link}: {error}"));
            // A picture has no headings.
            let target = String::from_utf8_lossy(&target);
            let anchors: Vec<String> = target.lines().filter(|line| line.starts_with('#')).map(slug).collect();
            assert!(anchor.is_empty() || anchors.iter().any(|a| a == anchor), "{document}: {link}: {anchors:?}");
        }
    }
}

#[test]
fn what_the_architecture_names_is_there() {
    let document = text("docs/ARCHITECTURE.md");
    let parts = ["benches/", "blender/", "crates/", "deploy/", "proto/", "src/", "tests/", "web/"];
    let named: Vec<&str> = document.split('`').skip(1).step_by(2).collect();
    let paths: Vec<&&str> =
        named.iter().filter(|code| parts.iter().any(|p| code.starts_with(p)) && !code.contains([' ', '*'])).collect();
    assert!(paths.len() > 60, "{paths:?}");
    for path in paths {
        assert!(repository().join(path).exists(), "{path}");
    }
}

/// The anchor of a heading.
fn slug(heading: &str) -> String {
    let words = heading.trim_start_matches('#').trim().to_lowercase();
    words
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}
