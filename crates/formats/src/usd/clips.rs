//! Value clips, as metadata describe them: files that have the values of a prim and of all below it,
//! one after another.

use crate::error::Fault;
use crate::scene::Allowance;

/// Files of one sequence, and pairs of time codes that map it.
pub(super) const MOST_CLIPS: usize = 1 << 12;
pub(super) const MOST_PAIRS: usize = 1 << 14;
/// Letters of a template, and digits of its numbers.
const LONGEST: usize = 1 << 12;
const MOST_DIGITS: usize = 19;
/// Time codes by which a mapping changes before it jumps.
const JUMP: f64 = 4e-9;

/// A value of the metadata.
pub(super) enum Entry {
    Text(String),
    Texts(Vec<String>),
    Number(f64),
    Pairs(Vec<[f64; 2]>),
}

/// One sequence of files.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Clips {
    /// The prim of the files that is the one with these metadata.
    pub(super) prim: String,
    pub(super) files: Vec<String>,
    /// A name with `#` for the digits of the number of each file.
    template: String,
    /// The first and the last number, the distance of two, and by how much later they are active.
    range: [f64; 2],
    stride: f64,
    offset: f64,
    /// From which time codes on which file counts, ascending.
    pub(super) active: Vec<[f64; 2]>,
    /// Time codes, ascending, and those within files that they are; all are as they are where there are none.
    pub(super) times: Vec<[f64; 2]>,
}

impl Clips {
    /// Takes a field of the metadata; gives whether it is understood.
    pub(super) fn take(&mut self, name: &str, entry: Entry) -> bool {
        match (name, entry) {
            ("primPath", Entry::Text(path)) => self.prim = path,
            ("assetPaths", Entry::Texts(files)) => self.files = files,
            ("templateAssetPath", Entry::Text(path)) => self.template = path,
            ("templateStartTime", Entry::Number(time)) => self.range[0] = time,
            ("templateEndTime", Entry::Number(time)) => self.range[1] = time,
            ("templateStride", Entry::Number(stride)) => self.stride = stride,
            ("templateActiveOffset", Entry::Number(offset)) => self.offset = offset,
            ("active", Entry::Pairs(pairs)) => self.active = pairs,
            ("times", Entry::Pairs(pairs)) => self.times = pairs,
            // Which attributes they have is seen in them.
            ("manifestAssetPath" | "interpolateMissingClipValues", _) => {}
            _ => return false,
        }
        true
    }

    /// With the files of a template by their names; none where it is not plain.
    pub(super) fn plain(mut self, is_there: impl Fn(&str) -> bool) -> Option<Self> {
        if self.files.is_empty() {
            self.list(is_there)?;
        }
        let is_ascending = |pairs: &[[f64; 2]]| {
            pairs.iter().flatten().all(|x| x.is_finite()) && pairs.is_sorted_by(|a, b| a[0] <= b[0])
        };
        let is_file = |&[_, file]: &[f64; 2]| file >= 0.0 && file.fract() == 0.0 && file < self.files.len() as f64;
        let is_plain = (1..=MOST_CLIPS).contains(&self.files.len())
            && (1..=MOST_PAIRS).contains(&self.active.len())
            && self.times.len() <= MOST_PAIRS
            && self.prim.starts_with('/')
            && !self.prim.contains(['{', '.'])
            && is_ascending(&self.active)
            && is_ascending(&self.times)
            && self.active.iter().all(is_file);
        is_plain.then_some(self)
    }

    /// Lists the files that a template names and that are there.
    fn list(&mut self, is_there: impl Fn(&str) -> bool) -> Option<()> {
        let (before, rest) = self.template.split_once('#')?;
        let after = rest.trim_start_matches('#');
        let digits = 1 + rest.len() - after.len();
        let [start, end] = self.range;
        let count = ((end - start) / self.stride).floor();
        if after.contains('#') || digits > MOST_DIGITS || self.template.len() > LONGEST {
            return None;
        }
        if !(0.0..MOST_CLIPS as f64).contains(&count) || self.stride <= 0.0 {
            return None;
        }
        let (mut files, mut active) = (Vec::new(), Vec::new());
        for k in 0..=count as usize {
            let time = start + k as f64 * self.stride;
            let name = format!("{before}{time:0digits$}{after}");
            if time.fract() == 0.0 && is_there(&name) {
                active.push([time + self.offset, files.len() as f64]);
                files.push(name);
            }
        }
        (self.files, self.active) = (files, active);
        Some(())
    }

    /// The samples at these times of a file, while the mapping from `start` to before `end` holds: time
    /// codes, and the times in the file that are then; beside samples, those at which the mapping changes.
    /// A mapping may have the same samples many times: the allowance is for all that it gives.
    pub(super) fn mapped(
        &self,
        samples: &[f64],
        [start, end]: [f64; 2],
        allowance: &mut Allowance,
    ) -> Result<Vec<(f64, f64)>, Fault> {
        let mut take = |count: usize| allowance.take(count as u64, 16).map(drop);
        let is_active = |time: f64| start <= time && time < end;
        if self.times.len() < 2 {
            let shift = self.times.first().map_or(0.0, |[time, inside]| time - inside);
            let before = |bound: f64| samples.partition_point(|&inside| inside + shift < bound);
            let within = &samples[before(start)..before(end)];
            take(within.len())?;
            return Ok(within.iter().map(|&inside| (inside + shift, inside)).collect());
        }
        let mut found = Vec::new();
        let first = self.times.partition_point(|pair| pair[0] < start).saturating_sub(1);
        for (k, pair) in self.times.windows(2).enumerate().skip(first) {
            if pair[0][0] >= end {
                break;
            }
            let [[begin, from], [stop, to]] = [pair[0], pair[1]];
            let is_over = stop < start || stop == start && k + 2 < self.times.len();
            if stop <= begin || is_over {
                continue;
            }
            take(2)?;
            let speed = (to - from) / (stop - begin);
            let inside = |time: f64| from + (time - begin) * speed;
            let first = begin.max(start);
            found.push((first, inside(first)));
            if speed != 0.0 {
                let last = if end < stop { inside(end) } else { to };
                let (low, high) = (inside(first).min(last), inside(first).max(last));
                let within =
                    samples.partition_point(|&sample| sample <= low)..samples.partition_point(|&sample| sample < high);
                take(within.len())?;
                let at = samples[within].iter().map(|&sample| (begin + (sample - from) / speed, sample));
                found.extend(at.filter(|&(time, _)| time > first && is_active(time)));
            }
            let next = self.times.get(k + 2);
            let jumps = next.is_some_and(|next| next[0] == stop);
            if jumps && stop <= end {
                found.push((stop - JUMP * stop.abs().max(1.0), to));
            } else if next.is_none() && is_active(stop) && samples.contains(&to) {
                found.push((stop, to));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.dedup_by(|later, earlier| later.0 == earlier.0);
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_a_template_are_those_that_are_there() {
        let template = |path: &str, stride: f64| {
            let mut clips = Clips { prim: "/model".to_owned(), ..Clips::default() };
            assert!(clips.take("templateAssetPath", Entry::Text(path.to_owned())));
            for (name, number) in [("templateStartTime", 8.0), ("templateEndTime", 11.0), ("templateStride", stride)] {
                assert!(clips.take(name, Entry::Number(number)));
            }
            clips.plain(|name| !name.contains("09"))
        };
        let clips = template("./a.###.usd", 1.0).unwrap();
        assert_eq!(clips.files, ["./a.008.usd", "./a.010.usd", "./a.011.usd"]);
        assert_eq!(clips.active, [[8.0, 0.0], [10.0, 1.0], [11.0, 2.0]]);
        assert_eq!(template("a.#.usd", 2.0).unwrap().files, ["a.8.usd", "a.10.usd"]);
        let (wide, long) = (format!("a.{}.usd", "#".repeat(70_000)), format!("{}a.#.usd", "./".repeat(3_000)));
        for (path, stride) in [
            ("a.usd", 1.0),
            ("a.##.##.usd", 1.0),
            ("a.#.usd", 0.0),
            ("a.#.usd", 1e-9),
            ("a.####################.usd", 1.0),
            (&wide, 1.0),
            (&long, 1.0),
        ] {
            assert_eq!(template(path, stride), None, "{path}");
        }
        assert!(!Clips::default().take("stage", Entry::Number(1.0)));
    }

    /// As usd-core has them.
    #[test]
    fn samples_are_where_the_mapping_has_them() {
        let clips = |times: &[[f64; 2]]| Mapping(Clips { times: times.to_vec(), ..Clips::default() });
        let all = [f64::NEG_INFINITY, f64::INFINITY];
        let samples = [0.0, 4.0, 8.0];
        let same = [(0.0, 0.0), (4.0, 4.0), (8.0, 8.0)];
        assert_eq!(clips(&[]).mapped(&samples, all), same);
        assert_eq!(clips(&[[0.0, 0.0], [8.0, 8.0]]).mapped(&samples, all), same);
        assert_eq!(clips(&[[0.0, 8.0], [8.0, 0.0]]).mapped(&samples, all), [(0.0, 8.0), (4.0, 4.0), (8.0, 0.0)]);
        assert_eq!(clips(&[[2.0, 0.0], [6.0, 8.0]]).mapped(&samples, [3.0, 5.0]), [(3.0, 2.0), (4.0, 4.0)]);
        let looped = clips(&[[0.0, 0.0], [8.0, 8.0], [8.0, 0.0], [16.0, 8.0]]).mapped(&samples, all);
        assert_eq!(looped.iter().map(|&(time, _)| time.round()).collect::<Vec<_>>(), [0.0, 4.0, 8.0, 8.0, 12.0, 16.0]);
        assert_eq!(looped.iter().map(|&(_, inside)| inside).collect::<Vec<_>>(), [0.0, 4.0, 8.0, 0.0, 4.0, 8.0]);
        // One that is held, then the next.
        let held = clips(&[[0.0, 1.0], [2.0, 1.0], [2.0, 2.0], [4.0, 2.0]]);
        let [(0.0, 1.0), (before, 1.0)] = held.mapped(&[1.0], [0.0, 2.0])[..] else { panic!() };
        assert!(before < 2.0 && before > 1.999_999);
        assert_eq!(held.mapped(&[2.0], [2.0, f64::INFINITY]), [(2.0, 2.0), (4.0, 2.0)]);
    }

    #[test]
    fn a_mapping_gives_no_more_than_it_may() {
        // A thousand times from the first sample to the last.
        let loops = |k: u32| [[f64::from(k), 0.0], [f64::from(k + 1), 1_000.0]];
        let clips = Clips { times: (0..1_000).flat_map(loops).collect(), ..Clips::default() };
        let samples: Vec<f64> = (0..=1_000).map(f64::from).collect();
        let count = |bytes: u64, range| clips.mapped(&samples, range, &mut Allowance(bytes)).map(|found| found.len());
        assert!(count(1 << 20, [f64::NEG_INFINITY, f64::INFINITY]).is_err());
        assert_eq!(count(1 << 25, [f64::NEG_INFINITY, f64::INFINITY]).ok(), Some(1_001_000));
        // What is not active counts for nothing.
        assert_eq!(count(1 << 10, [7.25, 7.28125]).ok(), Some(32));
        let plain = Clips::default();
        assert_eq!(plain.mapped(&samples, [3.5, 6.0], &mut Allowance(32)).ok(), Some(vec![(4.0, 4.0), (5.0, 5.0)]));
        assert!(plain.mapped(&samples, [3.5, 6.5], &mut Allowance(32)).is_err());
    }

    /// Without bound.
    struct Mapping(Clips);

    impl Mapping {
        fn mapped(&self, samples: &[f64], range: [f64; 2]) -> Vec<(f64, f64)> {
            self.0.mapped(samples, range, &mut Allowance(u64::MAX)).unwrap()
        }
    }
}
