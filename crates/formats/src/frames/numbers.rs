//! The numbers of frames, as the names of their files tell them.

use std::collections::{BTreeMap, BTreeSet};

/// Runs of missing frames that a message lists.
const LISTED: usize = 6;

/// The numbers in names that differ by nothing else: `f-2 f0 f1.5` or `walk.0010_left
/// walk.0011_left`. In the order of the names; `None` where a name has no number, two are equal, or
/// the names differ elsewhere.
pub(super) fn of_names(names: &[&str]) -> Option<Vec<f64>> {
    if names.len() < 2 {
        return None;
    }
    let prefix = prefix(names);
    let ends: Vec<&str> = names.iter().map(|name| &name[prefix..]).collect();
    let suffix = suffix(&ends);
    let parts: Vec<&str> =
        ends.iter().map(|end| Some(&end[..end.len().checked_sub(suffix)?])).collect::<Option<_>>()?;
    let numbers = parts.iter().map(|part| number(part)).collect::<Option<Vec<f64>>>()?;
    if let Some(fractions) = fractions(&names[0][..prefix], &parts)
        && !evenly_spaced(&numbers)
        && evenly_spaced(&fractions)
    {
        return Some(fractions);
    }
    (distinct(&numbers) && !are_versions(&parts, &numbers)).then_some(numbers)
}

/// `1.25 1.5 1.75` of names that begin with `f1.`.
fn fractions(begin: &str, parts: &[&str]) -> Option<Vec<f64>> {
    let whole = begin.strip_suffix('.')?;
    let digits = &whole[whole.trim_end_matches(|c: char| c.is_ascii_digit()).len()..];
    parts.iter().map(|part| number(&format!("{digits}.{part}"))).collect()
}

/// Whether no two numbers are equal.
pub(super) fn distinct(numbers: &[f64]) -> bool {
    steps(numbers).iter().all(|&step| step > 0.0)
}

/// Whether all steps between neighbours are the same.
pub(super) fn evenly_spaced(numbers: &[f64]) -> bool {
    let steps = steps(numbers);
    steps.iter().all(|step| (step - steps[0]).abs() <= 1e-6 * steps[0])
}

/// From each number to the next larger one.
fn steps(numbers: &[f64]) -> Vec<f64> {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// Bytes before the number: what all names begin with, less its digits and sign.
fn prefix(names: &[&str]) -> usize {
    let first = names[0].as_bytes();
    let same = |k: &usize| names.iter().all(|name| name.as_bytes().get(*k) == Some(&first[*k]));
    let end = (0..first.len()).take_while(same).count();
    let before_digits = |end: usize| first[..end].iter().rposition(|b| !b.is_ascii_digit()).map_or(0, |at| at + 1);
    let mut end = before_digits(end);
    // The point of `0.04` belongs to the number, and that of `shot2.0010` and `v0.001` does not.
    if let Some(before) = first[..end].strip_suffix(b".") {
        let whole = before_digits(before.len());
        let is_zero = whole < before.len() && before[whole..].iter().all(|&b| b == b'0');
        let is_named = whole > 0 && first[whole - 1].is_ascii_alphabetic();
        end = if is_zero && !is_named { whole } else { end };
    }
    // `walk-1` has a hyphen, `f_-1` and `-1` a sign.
    let separated = end < 2 || !first[end - 2].is_ascii_alphanumeric();
    if end > 0 && first[end - 1] == b'-' && separated {
        end -= 1;
    }
    (0..=end).rfind(|&k| names[0].is_char_boundary(k)).unwrap_or(0)
}

/// Bytes after the number: what all names end with, less its digits and fraction.
fn suffix(ends: &[&str]) -> usize {
    let last = ends[0].as_bytes();
    let from_end = |text: &[u8], k: usize| text.len().checked_sub(k + 1).map(|at| text[at]);
    let same = |k: &usize| ends.iter().all(|end| from_end(end.as_bytes(), *k) == from_end(last, *k));
    let mut length = (0..last.len()).take_while(same).count();
    loop {
        let rest = &last[last.len() - length..];
        match rest {
            [first, ..] if first.is_ascii_digit() || !ends[0].is_char_boundary(last.len() - length) => length -= 1,
            [b'.', digit, ..] if digit.is_ascii_digit() => length -= 1,
            _ => return length,
        }
    }
}

/// Whether `1.01 1.02 2.01 2.02` are frames 1 and 2 of two versions or takes: fractions of one
/// width come again and again, one apart in their last digit, and the numbers are not evenly
/// spaced.
fn are_versions(parts: &[&str], numbers: &[f64]) -> bool {
    let fractions: BTreeSet<&str> = parts.iter().map(|part| part.split_once('.').map_or("", |(_, f)| f)).collect();
    let width = fractions.first().map_or(0, |fraction| fraction.len());
    let unit = 10_f64.powi(-(width as i32));
    width > 1
        && fractions.len() < parts.len()
        && fractions.iter().all(|fraction| fraction.len() == width)
        && steps(numbers).iter().any(|&step| step < 1.5 * unit)
        && !evenly_spaced(numbers)
}

/// Decimal digits, with a sign and a fraction where there are any; none where `f64` would round.
fn number(text: &str) -> Option<f64> {
    let digits = text.strip_prefix('-').unwrap_or(text);
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, "0"));
    let plain = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    (plain(whole) && plain(fraction) && digits.len() <= 15).then(|| text.parse().ok())?.map(|x: f64| x + 0.0)
}

/// The frames that are missing from these numbers, in words such as `4 and 7 to 9`. Only whole
/// numbers are looked at, so that frames between frames are no gaps.
pub fn missing_frames(numbers: &[f64]) -> Option<String> {
    let whole: Vec<i64> = numbers.iter().filter(|x| x.fract() == 0.0 && x.abs() < 1e15).map(|&x| x as i64).collect();
    let steps: Vec<i64> = whole.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut often: BTreeMap<i64, usize> = BTreeMap::new();
    steps.iter().filter(|&&step| step > 0).for_each(|&step| *often.entry(step).or_default() += 1);
    let (&step, _) = often.iter().max_by_key(|&(&step, &count)| (count, -step))?;
    let gaps: Vec<[i64; 2]> = whole
        .windows(2)
        .filter(|pair| pair[1] - pair[0] > step)
        .map(|pair| [pair[0] + step, pair[1] - 1 - (pair[1] - 1 - pair[0]).rem_euclid(step)])
        .collect();
    let mut words: Vec<String> = gaps
        .iter()
        .take(LISTED)
        .map(|&[first, last]| match (last - first) / step {
            0 => first.to_string(),
            _ if step == 1 => format!("{first} to {last}"),
            _ => format!("{first} to {last} in steps of {step}"),
        })
        .collect();
    if gaps.len() > LISTED {
        words.push("more".to_owned());
    }
    let last = words.pop()?;
    Some(if words.is_empty() { last } else { format!("{} and {last}", words.join(", ")) })
}

/// A number as names have it, with at least `digits` digits before the point.
pub(super) fn padded(number: f64, digits: usize) -> String {
    let sign = if number < 0.0 { "-" } else { "" };
    let text = number.abs().to_string();
    let whole = text.split('.').next().unwrap_or_default().len();
    format!("{sign}{}{text}", "0".repeat(digits.saturating_sub(whole)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_differ_by_a_number_tell_it() {
        for (names, numbers) in [
            (vec!["f-2", "f-1", "f0", "f1"], vec![-2.0, -1.0, 0.0, 1.0]),
            (vec!["f1", "f1.5", "f2"], vec![1.0, 1.5, 2.0]),
            (vec!["frame_-002", "frame_-001"], vec![-2.0, -1.0]),
            (vec!["-2", "-1"], vec![-2.0, -1.0]),
            (vec!["walk-1", "walk-2", "walk-10"], vec![1.0, 2.0, 10.0]),
            (vec!["shot2.0010", "shot2.0011"], vec![10.0, 11.0]),
            (vec!["v2_0999_left", "v2_1000_left"], vec![999.0, 1000.0]),
            (vec!["f1.0", "f1.5", "f2.0", "f2.5"], vec![1.0, 1.5, 2.0, 2.5]),
            (vec!["é1", "é2"], vec![1.0, 2.0]),
            (vec!["0.04", "0.08", "0.12"], vec![0.04, 0.08, 0.12]),
            (vec!["0.5", "0.04", "0.45"], vec![0.5, 0.04, 0.45]),
            (vec!["t_-0.5", "t_-0.25"], vec![-0.5, -0.25]),
            (vec!["f0.98", "f0.99", "f1.00", "f1.01"], vec![0.98, 0.99, 1.0, 1.01]),
            (vec!["f1.250", "f1.500", "f1.750"], vec![250.0, 500.0, 750.0]),
            (vec!["f1.25", "f1.5", "f1.75"], vec![1.25, 1.5, 1.75]),
            (vec!["w_v2.8", "w_v2.9", "w_v2.11", "w_v2.12"], vec![8.0, 9.0, 11.0, 12.0]),
            (vec!["v2.9", "v2.10"], vec![9.0, 10.0]),
            (vec!["s2.9", "s2.10", "s2.12", "s2.13", "s2.14"], vec![9.0, 10.0, 12.0, 13.0, 14.0]),
            (vec!["sim_v1.001", "sim_v1.002", "sim_v1.004", "sim_v1.005"], vec![1.0, 2.0, 4.0, 5.0]),
            (vec!["sim_v0.001", "sim_v0.002", "sim_v0.004"], vec![1.0, 2.0, 4.0]),
            (vec!["shot2.8", "shot2.9", "shot2.10"], vec![8.0, 9.0, 10.0]),
            (vec!["shot2.010", "shot2.011"], vec![10.0, 11.0]),
            (vec!["shot0.0010", "shot0.0012"], vec![10.0, 12.0]),
            (vec!["frame_-5", "frame_-4"], vec![-5.0, -4.0]),
            (vec!["2024-01-05_v2.1_0007", "2024-01-05_v2.1_0008"], vec![7.0, 8.0]),
            (vec!["2024-01-05-7", "2024-01-05-8"], vec![7.0, 8.0]),
        ] {
            assert_eq!(of_names(&names), Some(numbers), "{names:?}");
        }
        for names in [
            vec!["a1", "b2"],
            vec!["run", "walk"],
            vec!["1", "01"],
            vec!["f1"],
            vec!["f", "f1"],
            vec!["è1", "é1"],
            vec!["v1.01", "v1.02", "v2.01", "v2.02"],
        ] {
            assert_eq!(of_names(&names), None, "{names:?}");
        }
    }

    #[test]
    fn missing_frames_are_named_and_a_regular_step_is_none() {
        for (numbers, missing) in [
            (vec![1.0, 2.0, 3.0], None),
            (vec![0.0, 2.0, 4.0, 6.0], None),
            (vec![-2.0, -1.0, 0.0], None),
            (vec![1.0, 1.5, 2.0, 3.0], None),
            (vec![7.0], None),
            (vec![], None),
            (vec![1.0, 2.0, 3.0, 5.0, 6.0, 10.0], Some("4 and 7 to 9")),
            (vec![0.0, 2.0, 4.0, 10.0], Some("6 to 8 in steps of 2")),
        ] {
            assert_eq!(missing_frames(&numbers).as_deref(), missing, "{numbers:?}");
        }
        let holes: Vec<f64> = (0..40).map(|k| f64::from(k + k / 4)).collect();
        assert!(missing_frames(&holes).is_some_and(|words| words.ends_with(" and more")));
    }

    #[test]
    fn numbers_are_written_as_they_are_read() {
        for (number, text) in [(7.0, "0007"), (-2.0, "-0002"), (1.5, "0001.5"), (12345.0, "12345")] {
            assert_eq!(padded(number, 4), text);
            assert_eq!(super::number(text), Some(number));
        }
    }
}
