//! What objects of the bucket are called. `<path>@<taken>` is a file as a whole, and `<path>@<taken>.<number>.<offset>` what was written to one at that offset,
//! by the process that took the database as the so-manieth. What a process sends that was taken over since has another name than what the next one sends.

use std::cmp::Ordering;

/// What an object has of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// All of it.
    Whole,
    /// Bytes from `offset` on; later numbers replace what earlier ones have.
    Piece { number: u64, offset: u64 },
}

/// An object of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Object {
    /// How often the database was taken when it was written.
    pub(super) taken: i64,
    pub(super) part: Part,
    pub(super) bytes: u64,
}

impl Object {
    /// Its name in the bucket.
    pub(super) fn key(&self, path: &str) -> String {
        match self.part {
            Part::Whole => format!("{path}@{}", self.taken),
            Part::Piece { number, offset } => format!("{path}@{}.{number}.{offset}", self.taken),
        }
    }

    /// Where its bytes end in the file.
    pub(super) fn end(&self) -> u64 {
        match self.part {
            Part::Whole => self.bytes,
            Part::Piece { offset, .. } => offset.saturating_add(self.bytes),
        }
    }

    fn order(&self) -> (i64, u64) {
        match self.part {
            Part::Whole => (self.taken, 0),
            Part::Piece { number, .. } => (self.taken, number),
        }
    }
}

/// The file of an object and what it has of it; `None` for a name that is none of ours.
pub(super) fn parse(key: &str, bytes: u64) -> Option<(&str, Object)> {
    let (path, rest) = key.rsplit_once('@')?;
    let mut numbers = rest.split('.');
    let taken = numbers.next()?.parse().ok()?;
    let part = match (numbers.next(), numbers.next(), numbers.next()) {
        (None, ..) => Part::Whole,
        (Some(number), Some(offset), None) => {
            Part::Piece { number: number.parse().ok()?, offset: offset.parse().ok()? }
        }
        _ => return None,
    };
    let object = Object { taken, part, bytes };
    // Not "+1" or "007", which would be written otherwise.
    (object.key(path) == key && !path.is_empty()).then_some((path, object))
}

/// Objects of one file, in the order in which they are to be laid over each other: the last whole one, then what was written since. Those before are of no use.
pub(super) fn in_force(objects: &mut [Object]) -> &[Object] {
    objects.sort_by(|a, b| a.order().cmp(&b.order()).then(Ordering::Equal));
    let first = objects.iter().rposition(|object| object.part == Part::Whole).unwrap_or(0);
    &objects[first..]
}

/// Length of a file of these objects.
pub(super) fn length(objects: &[Object]) -> u64 {
    in_force(&mut objects.to_vec()).iter().map(Object::end).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(taken: i64, part: Part) -> Object {
        Object { taken, part, bytes: 3 }
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        let piece = Part::Piece { number: 12, offset: 1_048_576 };
        for part in [Part::Whole, piece] {
            let key = object(7, part).key("sessions/a-1/frames-0000000000");
            assert_eq!(parse(&key, 3), Some(("sessions/a-1/frames-0000000000", object(7, part))));
        }
        for other in ["x", "@1", "x@", "x@+1", "x@01", "x@1.2", "x@1.2.3.4", "x@1.a.2", "x@1.2.-3"] {
            assert_eq!(parse(other, 3), None, "{other}");
        }
    }

    #[test]
    fn what_was_written_last_is_in_force() {
        let piece = |taken, number| object(taken, Part::Piece { number, offset: 0 });
        let (whole, later) = (object(2, Part::Whole), object(3, Part::Whole));
        assert_eq!(in_force(&mut [piece(3, 1), piece(2, 10), piece(2, 9)]), [piece(2, 9), piece(2, 10), piece(3, 1)]);
        assert_eq!(in_force(&mut [later, piece(2, 5), whole]), [later]);
        assert_eq!(in_force(&mut [piece(3, 1), whole, piece(1, 4)]), [whole, piece(3, 1)]);
        assert_eq!(in_force(&mut []), []);
    }
}
