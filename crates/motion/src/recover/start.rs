//! Whether the first surface is about where the template is, and about as large, by most points:
//! poses differ, and parts may not be seen.

use super::placement::seen;
use super::spread::Spread;
use super::{RecoverError, RecoverOptions};
use cager_geometry::mesh::{Model, Point, diagonal};
use cager_geometry::vector::distance;
use cager_shape::registration::{NearestPoints, Observation};
use std::path::Path;

/// Surfaces that reach so many times farther than the template are larger.
const LARGER: f64 = 2.0;
/// Those that reach less than one over this are smaller; in a crouch they reach less.
const SMALLER: f64 = 2.5;
/// A point of the template is on the surface that is nearer than this share of the diagonal.
const ON_SURFACE: f64 = 0.05;

/// Refuses a first surface of another size or place, but for what is brought to it. A person is
/// looked for anywhere, and not scaled.
pub(super) fn check_surface(
    template: &Model,
    (path, surface): (&Path, &Observation),
    options: &RecoverOptions,
    is_person: bool,
) -> Result<(), RecoverError> {
    let Some(own) = seen(template).filter(|_| !options.scale).map(|seen| seen.points) else { return Ok(()) };
    let (Some(rest), Some(there)) = (Spread::of(&own), Spread::of(&surface.points)) else { return Ok(()) };
    let size = diagonal(&template.points);
    let (scale, distance) = (there.radius / rest.radius, distance(there.centre, rest.centre));
    let is_sized = (1.0 / SMALLER..LARGER).contains(&scale);
    let is_placed = options.align || is_person || distance < size;
    // Where there is more than the subject, such as a floor.
    if (is_sized && is_placed) || lies_on(&own, &surface.points, ON_SURFACE * size) {
        return Ok(());
    }
    let path = path.to_owned();
    Err(match (is_sized, is_person) {
        (false, true) => RecoverError::OtherPerson { path, scale },
        (false, false) => RecoverError::OtherSize { path, scale },
        (true, _) => RecoverError::Elsewhere { path, distance, diagonals: distance / size },
    })
}

/// Whether three of four points of a template are near a surface.
fn lies_on(template: &[Point], surface: &[Point], reach: f64) -> bool {
    let tree = NearestPoints::new(surface.iter().copied());
    let near = template.iter().step_by(10).filter(|&&p| tree.nearest(p).1 < reach * reach);
    4 * near.count() > 3 * template.len().div_ceil(10)
}

/// A size beside another, `1.150 times as large as`, `about 1000 times smaller than`.
pub fn as_large(scale: f64) -> String {
    match scale {
        0.2..10.0 => format!("{scale:.3} times as large as"),
        _ if scale < 1.0 => format!("about {} times smaller than", rounded(1.0 / scale)),
        _ => format!("about {} times as large as", rounded(scale)),
    }
}

/// To two digits.
fn rounded(number: f64) -> f64 {
    format!("{number:.1e}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tall block that stands on the ground, as a mesh and as points of its surface.
    fn block(height: f64) -> (Model, Vec<Point>) {
        const ROUND: [[f64; 2]; 4] = [[0.0, 0.0], [0.4, 0.0], [0.4, 0.3], [0.0, 0.3]];
        let level = |k: usize| ROUND.map(|[x, y]| [x, y, k as f64 / 2.0 * height]);
        let mut block = Model { points: (0..3).flat_map(level).collect(), ..Model::default() };
        let wall = |k: u32| [k, k / 4 * 4 + (k + 1) % 4, k / 4 * 4 + (k + 1) % 4 + 4, k + 4];
        let sides = (0..8).map(wall).chain([[3, 2, 1, 0], [8, 9, 10, 11]]);
        sides.for_each(|side| block.faces.push(&side));
        let points = seen(&block).expect("a surface").points;
        (block, points)
    }

    fn check([align, scale, is_person]: [bool; 3], points: Vec<Point>) -> Result<(), RecoverError> {
        let surface = Observation { normals: vec![[0.0, 0.0, 1.0]; points.len()], points };
        let options = RecoverOptions { align, scale, up: None, offsets: false, force: false, points: 0, colors: false };
        check_surface(&block(1.8).0, (Path::new("scan.ply"), &surface), &options, is_person)
    }

    const AS_IT_IS: [bool; 3] = [false; 3];

    #[test]
    fn parts_poses_and_surroundings_are_no_other_size_or_place() {
        let whole = || block(1.8).1;
        let moved = |p: &Point, by: f64| [p[0] + by, p[1], p[2]];
        let floor = (0..4000).map(|k| [f64::from(k % 80) * 0.5 - 30.0, f64::from(k / 80) * 0.5 - 10.0, 0.0]);
        for (points, what) in [
            (whole(), "as it is"),
            (whole().into_iter().filter(|p| p[2] > 0.9).collect(), "the upper half"),
            (block(1.0).1, "in a crouch"),
            (block(3.0).1, "arms up"),
            (whole().iter().map(|p| moved(p, 1.5)).collect(), "a step on"),
            (whole().into_iter().step_by(4).chain(floor).collect(), "on a floor"),
        ] {
            assert!(check(AS_IT_IS, points).is_ok(), "{what}");
        }
    }

    #[test]
    fn another_size_or_place_is_refused_unless_it_is_to_be_found() {
        let scaled = |scale: f64| block(1.8).1.iter().map(|p| p.map(|x| scale * x)).collect::<Vec<_>>();
        for scale in [1000.0, 2.54, 0.3937, 0.01] {
            for align in [false, true] {
                let found = check([align, false, false], scaled(scale));
                let near = |found: f64| (found / scale - 1.0).abs() < 0.05;
                assert!(matches!(found, Err(RecoverError::OtherSize { scale, .. }) if near(scale)), "{scale}");
            }
            assert!(check([true, true, false], scaled(scale)).is_ok());
            let found = check([false, false, true], scaled(scale));
            assert!(matches!(found, Err(RecoverError::OtherPerson { .. })));
        }
        let away = || block(1.8).1.iter().map(|&[x, y, z]| [x, y + 3.0, z]).collect::<Vec<_>>();
        let found = check(AS_IT_IS, away());
        assert!(matches!(found, Err(RecoverError::Elsewhere { distance, .. }) if (distance - 3.0).abs() < 0.1));
        assert!(check([true, false, false], away()).is_ok());
        assert!(check([false, false, true], away()).is_ok());
    }

    #[test]
    fn sizes_are_told_in_words() {
        assert_eq!(as_large(1.15), "1.150 times as large as");
        assert_eq!(as_large(1013.0), "about 1000 times as large as");
        assert_eq!(as_large(0.00985), "about 100 times smaller than");
    }
}
