//! Where most of some points are, whatever a few of them are.

use cager_geometry::mesh::{Model, Point};
use cager_geometry::vector::distance;

/// The middle of some points, and how far they reach around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    /// The median of each coordinate.
    pub(super) centre: Point,
    /// Three of four points are nearer to it.
    pub(super) radius: f64,
}

/// Points that are looked at, at the most.
const LOOKED_AT: usize = 5000;
/// The share of points within the radius.
const WITHIN: f64 = 0.75;
/// Fewer points have no strays among them.
const MIN_POINTS: usize = 100;
/// Strays are farther from the centre than so many radii.
const FAR: f64 = 5.0;
/// One in so many points may be that far; where more are, they belong there.
const FAR_EVERY: usize = 100;
/// A far point with so many others within a radius is part of something.
const COMPANY: usize = 8;

impl Spread {
    /// None without points, and where most are in one place.
    pub(super) fn of(points: &[Point]) -> Option<Self> {
        let every = points.len().div_ceil(LOOKED_AT).max(1);
        let some = || points.iter().step_by(every);
        let centre = [0, 1, 2].map(|k| quantile(some().map(|p| p[k]).collect(), 0.5));
        let radius = quantile(some().map(|&p| distance(p, centre)).collect(), WITHIN);
        (radius > 0.0 && radius.is_finite()).then_some(Self { centre, radius })
    }
}

/// NaN of nothing.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get((share * values.len() as f64) as usize).copied().unwrap_or(f64::NAN)
}

/// Takes out points of a cloud that lie alone and far from all others. How many there were.
pub(super) fn leave_out_strays(cloud: &mut Model) -> usize {
    let strays = strays(&cloud.points);
    if strays.is_empty() {
        return 0;
    }
    let mut stays = vec![true; cloud.points.len()];
    strays.iter().for_each(|&stray| stays[stray] = false);
    keep(&mut cloud.points, &stays);
    keep(&mut cloud.normals, &stays);
    keep(&mut cloud.colors, &stays);
    strays.len()
}

fn keep<T>(values: &mut Vec<T>, stays: &[bool]) {
    let mut stays = stays.iter();
    values.retain(|_| *stays.next().unwrap_or(&true));
}

fn strays(points: &[Point]) -> Vec<usize> {
    let Some(Spread { centre, radius }) = Spread::of(points).filter(|_| points.len() >= MIN_POINTS) else {
        return Vec::new();
    };
    let beyond = |radii: f64| -> Vec<usize> {
        (0..points.len()).filter(|&k| distance(points[k], centre) > radii * radius).collect()
    };
    let far = beyond(FAR);
    if far.is_empty() || far.len() > points.len() / FAR_EVERY {
        return Vec::new();
    }
    let around = beyond(FAR - 1.0);
    let is_alone = |&k: &usize| {
        // Points that are written for none are often many in one place.
        let beside = around.iter().map(|&other| distance(points[k], points[other]));
        beside.filter(|&apart| apart > 0.0 && apart < radius).take(COMPANY).count() < COMPANY
    };
    far.into_iter().filter(is_alone).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points all over a ball.
    fn ball(count: usize, centre: Point, radius: f64) -> Vec<Point> {
        let point = |k: i32| [0.8192, 0.6711, 0.5497].map(|step| 2.0 * (step * f64::from(k)).fract() - 1.0);
        let inside = (1..).map(point).filter(|&p| distance(p, [0.0; 3]) < 1.0);
        inside.take(count).map(|p| [0, 1, 2].map(|k| centre[k] + radius * p[k])).collect()
    }

    fn left_out(points: Vec<Point>) -> usize {
        let before = points.len();
        let mut cloud = Model { normals: points.clone(), colors: vec![[1; 3]; before], points, ..Model::default() };
        let count = leave_out_strays(&mut cloud);
        assert_eq!([cloud.normals.len(), cloud.colors.len()], [before - count; 2]);
        assert_eq!(cloud.points, cloud.normals, "the others keep their order");
        count
    }

    #[test]
    fn points_alone_and_far_away_are_left_out() {
        let body = || ball(2000, [3.0, 0.0, 0.0], 1.0);
        assert_eq!(left_out(body()), 0);
        for far in [10.0, 1e6, 1e200] {
            let with = |more: &[Point]| left_out([&more[..1], &body(), &more[1..]].concat());
            assert_eq!(with(&[[far; 3]]), 1, "{far}");
            assert_eq!(with(&[[far; 3], [-far, 0.0, 0.0], [far; 3]]), 3, "{far}");
        }
        assert_eq!(left_out([body(), vec![[1e6; 3]; 15]].concat()), 15, "in one place");
    }

    #[test]
    fn parts_and_surroundings_stay() {
        let body = || ball(2000, [0.0; 3], 1.0);
        assert_eq!(left_out([body(), ball(19, [20.0, 0.0, 0.0], 0.1)].concat()), 0, "a ball that is thrown");
        assert_eq!(left_out([body(), ball(400, [0.0; 3], 30.0)].concat()), 0, "many around it");
        assert_eq!(left_out([ball(60, [0.0; 3], 1.0), vec![[50.0; 3]]].concat()), 0, "few points");
        assert_eq!(left_out(vec![[2.0; 3]; 500]), 0, "one place");
    }

    #[test]
    fn a_few_points_do_not_change_the_spread() {
        let body = ball(3000, [1.0, 2.0, 3.0], 2.0);
        let [alone, with] = [body.clone(), [body, vec![[1e9; 3]; 30]].concat()].map(|points| Spread::of(&points));
        let (alone, with) = (alone.expect("points"), with.expect("points"));
        assert!((alone.radius - with.radius).abs() < 0.05 && distance(alone.centre, with.centre) < 0.2);
        assert_eq!(Spread::of(&[]), None);
    }
}
