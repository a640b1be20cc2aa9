//! Names beside each other in a file, each of which is there once.

use std::collections::{HashMap, HashSet};

/// Names that are taken.
#[derive(Default)]
pub(crate) struct Names {
    taken: HashSet<String>,
    /// The last number behind each.
    numbers: HashMap<String, usize>,
}

impl Names {
    /// Adds a name, with a number behind it where it is taken.
    pub(crate) fn add(&mut self, name: &str) -> String {
        let mut found = name.to_owned();
        while !self.taken.insert(found.clone()) {
            let number = self.numbers.entry(name.to_owned()).or_default();
            *number += 1;
            found = format!("{name}_{number}");
        }
        found
    }
}
