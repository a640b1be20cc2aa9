//! The order in which people number files.

use std::cmp::Ordering;

/// Compares with runs of digits as numbers: `2.obj` comes before `10.obj`.
pub(crate) fn compare(a: &[u8], b: &[u8]) -> Ordering {
    let (mut x, mut y) = (a, b);
    while let ([p, ..], [q, ..]) = (x, y) {
        let order = if p.is_ascii_digit() && q.is_ascii_digit() {
            let (m, n);
            (m, x) = split_number(x);
            (n, y) = split_number(y);
            m.len().cmp(&n.len()).then_with(|| m.cmp(n))
        } else {
            (x, y) = (&x[1..], &y[1..]);
            p.cmp(q)
        };
        if order.is_ne() {
            return order;
        }
    }
    // `1.obj` and `01.obj` differ by their zeros alone.
    x.len().cmp(&y.len()).then_with(|| a.cmp(b))
}

/// The leading digits without their zeros, and the rest.
fn split_number(text: &[u8]) -> (&[u8], &[u8]) {
    let end = text.iter().position(|c| !c.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    let zeros = digits.iter().take_while(|&&c| c == b'0').count();
    (&digits[zeros..], rest)
}

#[cfg(test)]
mod tests {
    use super::compare;

    #[test]
    fn numbers_count_as_numbers_wherever_they_stand() {
        let sorted = [
            "0.obj",
            "01.obj",
            "1.obj",
            "2.obj",
            "10.obj",
            "99999999999999999999998.obj",
            "99999999999999999999999.obj",
            "a/take2/frame9.obj",
            "a/take2/frame10.obj",
            "a/take10/frame1.obj",
            "frame",
            "frame1",
            "frame1a",
            "frame1b",
        ];
        let mut shuffled = sorted;
        shuffled.reverse();
        shuffled.sort_by(|a, b| compare(a.as_bytes(), b.as_bytes()));
        assert_eq!(shuffled, sorted);
    }
}
