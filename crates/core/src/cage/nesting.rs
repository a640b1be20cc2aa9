//! Which connected parts of a mesh lie inside others: rays through one tree over the faces of all of them.

use crate::mesh::{Point, bounds};
use crate::vector::sub;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// The connected parts of a triangle mesh, to be asked which of them the others enclose.
pub struct Nesting<'a> {
    vertices: &'a [Point],
    triangles: &'a [[u32; 3]],
    part_of: &'a [u32],
    /// A face of each part.
    first: Vec<u32>,
    /// The axis of all rays.
    axis: usize,
    /// The faces as a balanced tree: the root of any stretch of them is in its middle.
    order: Vec<u32>,
    /// Bounds of the stretch that each is the root of.
    boxes: Vec<[Point; 2]>,
}

impl<'a> Nesting<'a> {
    /// Of triangles whose vertices exist, and the part that each belongs to: numbers from 0 on without gaps.
    pub fn new(vertices: &'a [Point], triangles: &'a [[u32; 3]], part_of: &'a [u32]) -> Self {
        let mut first = vec![0; part_of.iter().max().map_or(0, |&last| last as usize + 1)];
        for (face, &part) in part_of.iter().enumerate().rev() {
            first[part as usize] = face as u32;
        }
        // Along the axis that the parts are least spread over, rays meet the fewest of them.
        let starts: Vec<Point> = first.iter().map(|&f| vertices[triangles[f as usize][0] as usize]).collect();
        let (low, high) = bounds(&starts);
        let spread = sub(high, low);
        let axis = (1..3).fold(0, |best, k| if spread[k] < spread[best] { k } else { best });
        let mut nesting = Self { vertices, triangles, part_of, first, axis, order: Vec::new(), boxes: Vec::new() };
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut boxes = vec![[[0.0; 3]; 2]; order.len()];
        nesting.grow(&mut order, &mut boxes);
        (nesting.order, nesting.boxes) = (order, boxes);
        nesting
    }

    /// Whether other parts have a part inside, each counted by its `sign`: 1 as it is, −1 turned inside out.
    pub fn is_enclosed(&self, part: u32, sign: impl Fn(u32) -> i32) -> bool {
        let corners = self.corners(self.first[part as usize]);
        let [a, b, c] = corners;
        // A vertex may lie on a part that it only touches.
        let middle = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
        let others = |other: u32| if other == part { 0 } else { sign(other) };
        [a, middle].into_iter().any(|p| self.winding(p, 0..self.order.len(), &others) > 0)
    }

    /// The corners of a face, the axis of the rays first.
    fn corners(&self, face: u32) -> [Point; 3] {
        self.triangles[face as usize].map(|v| {
            let p = self.vertices[v as usize];
            [0, 1, 2].map(|k| p[(self.axis + k) % 3])
        })
    }

    /// Orders faces as a tree, by the medians of the longest sides.
    fn grow(&self, order: &mut [u32], boxes: &mut [[Point; 2]]) {
        if order.is_empty() {
            return;
        }
        let corners: Vec<Point> = order.iter().flat_map(|&face| self.corners(face)).collect();
        let (low, high) = bounds(&corners);
        let size = sub(high, low);
        let longest = (1..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
        let centre = |face: u32| self.corners(face).map(|p| p[longest]).iter().sum::<f64>();
        let middle = order.len() / 2;
        order.select_nth_unstable_by(middle, |&f, &g| centre(f).total_cmp(&centre(g)).then(f.cmp(&g)));
        boxes[middle] = [low, high];
        let ((left, right), (left_boxes, right_boxes)) = (order.split_at_mut(middle), boxes.split_at_mut(middle));
        self.grow(left, left_boxes);
        self.grow(&mut right[1..], &mut right_boxes[1..]);
    }

    /// The signed number of faces of a stretch that the ray from `p` leaves through.
    fn winding(&self, p: Point, stretch: std::ops::Range<usize>, sign: &impl Fn(u32) -> i32) -> i32 {
        if stretch.is_empty() {
            return 0;
        }
        let root = stretch.start.midpoint(stretch.end);
        let [low, high] = self.boxes[root];
        if p[0] > high[0] || (1..3).any(|k| p[k] < low[k] || p[k] > high[k]) {
            return 0;
        }
        let face = self.order[root];
        let here = match sign(self.part_of[face as usize]) {
            0 => 0,
            sign => sign * crossing(p, self.corners(face)),
        };
        here + self.winding(p, stretch.start..root, sign) + self.winding(p, root + 1..stretch.end, sign)
    }
}

/// 1 where the ray from `p` along the first axis leaves through a triangle, −1 where it enters, 0 where it misses. Where it would meet an edge, `p` is
/// moved by infinitely little, the same for all triangles.
fn crossing(p: Point, [a, b, c]: [Point; 3]) -> i32 {
    let turns = [turn(a, b, p), turn(b, c, p), turn(c, a, p)];
    if turns[0] == 0 || turns[0] != turns[1] || turns[1] != turns[2] {
        return 0;
    }
    let at = |[x, y, z]: Point| Coord3D { x, y, z };
    // Positive where p lies in front of the plane.
    let side = -orient3d(at(a), at(b), at(c), at(p));
    match turns[0] {
        1 if side < 0.0 => 1,
        -1 if side > 0.0 => -1,
        _ => 0,
    }
}

/// Sign of the turn a, b, p across the ray, with `p` moved by (ε, ε²); 0 only where a and b coincide there.
fn turn(a: Point, b: Point, p: Point) -> i32 {
    let at = |p: Point| Coord { x: p[1], y: p[2] };
    let exact = orient2d(at(a), at(b), at(p));
    let by = if exact != 0.0 {
        exact
    } else if a[2] != b[2] {
        a[2] - b[2]
    } else {
        b[1] - a[1]
    };
    i32::from(by > 0.0) - i32::from(by < 0.0)
}
