//! `cager formats`.

use super::print;
use anyhow::Result;
use cager_formats::{FORMATS, Listed};

pub(super) fn run() -> Result<()> {
    let row = |[format, name, files, holds, says]: [&str; 5]| {
        format!("{format:<7} {name:<35} {files:<14} {holds:<17} {says}\n")
    };
    let mut text = row(["format", "name", "files are", "a file holds", "it says"]);
    for Listed { extension, name, read, written, animated, says } in FORMATS {
        let files = match (read, written) {
            (true, true) => "read, written",
            (true, false) => "read",
            _ => "written",
        };
        let holds = if *animated { "all frames" } else { "one mesh or frame" };
        text += &row([&format!(".{extension}"), name, files, holds, says]);
    }
    text += "\nUnits and axes that files say are kept, and a capture is brought to those of its rest pose; --unit and \
             --up are for files that say none.\n";
    print(&text)
}
