//! The numbers of frames, as the names of their files tell them.

use std::collections::BTreeMap;

/// Runs of missing frames that a message lists.
const LISTED: usize = 6;

/// The numbers in names that differ by nothing else: `f-2 f0 f1.5` or
/// `walk.0010_left walk.0011_left`. In the order of the names; `None` where a name has no number,
/// two are equal, or the names differ elsewhere.
pub(super) fn of_names(names: &[&str]) -> Option<Vec<f64>> {
    if names.len() < 2 {
        return None;
    }
    let prefix = prefix(names);
    let ends: Vec<&str> = names.iter().map(|name| &name[prefix..]).collect();
    let suffix = suffix(&ends);
    let parts: Vec<&str> =
        ends.iter().map(|end| Some(&end[..end.len().checked_sub(suffix)?])).collect::<Option<_>>()?;
    if are_versions(&parts) {
        return None;
    }
    let numbers = fractions(&names[0][..prefix], &parts)
        .or_else(|| parts.iter().map(|part| number(part)).collect::<Option<Vec<f64>>>())?;
    distinct(&numbers).then_some(numbers)
}

/// Whether no two numbers are equal.
pub(super) fn distinct(numbers: &[f64]) -> bool {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.windows(2).all(|pair| pair[0] < pair[1])
}

/// Whether all steps between neighbours are the same.
pub(super) fn evenly_spaced(numbers: &[f64]) -> bool {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let steps: Vec<f64> = sorted.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.iter().all(|step| (step - steps[0]).abs() <= 1e-6 * steps[0])
}

/// Numbers whose whole part is in the prefix, as of `0.04 0.08` or `f1.25 f1.5`; none where the
/// point before the digits only separates them from a name that ends in a digit, as in
/// `shot2.0010 shot2.0011`.
fn fractions(prefix: &str, parts: &[&str]) -> Option<Vec<f64>> {
    let before = prefix.strip_suffix('.')?;
    let name = before.trim_end_matches(|c: char| c.is_ascii_digit());
    let whole = &before[name.len()..];
    let digits = parts.iter().all(|part| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit()));
    if whole.is_empty() || !digits {
        return None;
    }
    // As in `_-0.5`, but not in `walk-0.5`.
    let stem = name.strip_suffix('-').filter(|stem| !stem.ends_with(|c: char| c.is_alphanumeric()));
    let sign = if stem.is_some() { "-" } else { "" };
    let decimals: Vec<f64> =
        parts.iter().map(|part| number(&format!("{sign}{whole}.{part}"))).collect::<Option<_>>()?;
    let counted: Vec<f64> = parts.iter().map(|part| number(part)).collect::<Option<_>>()?;
    let width = parts[0].len();
    let word = name.rsplit(|c: char| !c.is_alphabetic()).next().unwrap_or_default();
    let is_zero = whole.bytes().all(|b| b == b'0') && !matches!(word, "v" | "ver" | "version" | "take");
    let separates = if parts.iter().all(|part| part.len() == width) {
        // The order is the same either way; frames of renderers have four digits.
        !is_zero || width >= 4 && !word.is_empty()
    } else {
        // Digits that are not filled up count, as in `shot2.9 shot2.10`, unless only as decimals
        // they have even steps.
        let filled = parts.iter().any(|part| part.len() > 1 && part.starts_with('0'));
        let even = |numbers: &[f64]| numbers.len() > 2 && evenly_spaced(numbers);
        !filled && if is_zero { even(&counted) } else { even(&counted) || !even(&decimals) }
    };
    (!separates).then_some(decimals)
}

/// Bytes before the number: what all names begin with, less the digits and the sign that belong to
/// the number.
fn prefix(stems: &[&str]) -> usize {
    let first = stems[0].as_bytes();
    let same = |k: &usize| stems.iter().all(|stem| stem.as_bytes().get(*k) == Some(&first[*k]));
    let mut end = (0..first.len()).take_while(same).count();
    while end > 0 && first[end - 1].is_ascii_digit() {
        end -= 1;
    }
    // `walk-1` has a hyphen, `f_-1` and `-1` a sign.
    let separated = end < 2 || !first[end - 2].is_ascii_alphanumeric();
    if end > 0 && first[end - 1] == b'-' && separated {
        end -= 1;
    }
    while !stems[0].is_char_boundary(end) {
        end -= 1;
    }
    end
}

/// Bytes after the number: what all names end with, less the digits and the fraction that belong to
/// the number.
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

/// Whether `1.01 1.02 2.01 2.02` are frames 1 and 2 of two versions or takes: few whole numbers
/// that follow each other, again and again.
fn are_versions(parts: &[&str]) -> bool {
    let mut versions: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    let width = parts[0].rsplit('.').next().map_or(0, str::len);
    for part in parts {
        match part.split_once('.').map(|(version, frame)| (version, frame, frame.parse())) {
            Some((version, frame, Ok(number))) if frame.len() == width => {
                versions.entry(version).or_default().push(number);
            }
            _ => return false,
        }
    }
    let most = 10_u64.saturating_pow(width as u32) / 2;
    let counted = |frames: &mut Vec<u64>| {
        frames.sort_unstable();
        frames.len() > 1 && frames.len() as u64 <= most && frames.windows(2).all(|pair| pair[1] == pair[0] + 1)
    };
    let decimals: Option<Vec<f64>> = parts.iter().map(|part| number(part)).collect();
    width > 1
        && versions.len() > 1
        && versions.values_mut().all(counted)
        && decimals.is_none_or(|decimals| !evenly_spaced(&decimals))
}

/// Decimal digits, with a sign and a fraction where there are any; none where `f64` would round.
fn number(text: &str) -> Option<f64> {
    let digits = text.strip_prefix('-').unwrap_or(text);
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, "0"));
    let plain = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    (plain(whole) && plain(fraction) && digits.len() <= 15).then(|| text.parse().ok())?.map(|x: f64| x + 0.0)
}

/// The frames that are missing from these numbers, in words such as `4, 7–9`; none where they have
/// the same distance throughout. Only whole numbers are looked at, so that frames between frames
/// are no gaps.
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

/// A number as names have it: at least `digits` digits before the point, and only as many after it
/// as there must be.
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
            (vec!["f1.25", "f1.5", "f1.75"], vec![1.25, 1.5, 1.75]),
            (vec!["f0.98", "f0.99", "f1.00", "f1.01"], vec![0.98, 0.99, 1.0, 1.01]),
            (vec!["f1.250", "f1.500", "f1.750"], vec![250.0, 500.0, 750.0]),
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
