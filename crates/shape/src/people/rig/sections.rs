//! Cross-sections of a surface, and distances along it.

use cager_geometry::topology::UnionFind;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// A surface of a person, left along x, up along y, forward along z; vertices in one place are one.
pub(super) struct Body {
    pub(super) points: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Axis-aligned extent of points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Extent {
    pub(super) const NONE: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    pub(super) fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::NONE, |e, p| Self { low: e.low.min(p), high: e.high.max(p) })
    }

    pub(super) fn and(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub(super) fn center(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    pub(super) fn size(&self) -> DVec3 {
        self.high - self.low
    }

    pub(super) fn is_none(&self) -> bool {
        self.low.x > self.high.x
    }
}

impl Body {
    /// Joins vertices that share their position exactly.
    pub(super) fn new(points: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut names: HashMap<[u64; 3], u32> = HashMap::new();
        let mut kept: Vec<DVec3> = Vec::new();
        let of: Vec<u32> = points
            .iter()
            .map(|p| {
                *names.entry(p.to_array().map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                    kept.push(*p);
                    kept.len() as u32 - 1
                })
            })
            .collect();
        Self { points: kept, triangles: triangles.iter().map(|t| t.map(|v| of[v as usize])).collect() }
    }

    /// The connected parts of the section by the plane through `through`, each as the points where the plane crosses edges.
    pub(super) fn section(&self, through: DVec3, normal: DVec3) -> Vec<Vec<DVec3>> {
        let height: Vec<f64> = self.points.iter().map(|p| (*p - through).dot(normal)).collect();
        let mut numbers: HashMap<[u32; 2], usize> = HashMap::new();
        let mut crossings: Vec<DVec3> = Vec::new();
        let mut pairs: Vec<[usize; 2]> = Vec::new();
        for triangle in &self.triangles {
            let above = triangle.map(|v| height[v as usize] >= 0.0);
            if above[0] == above[1] && above[1] == above[2] {
                continue;
            }
            let mut ends = [0; 2];
            let mut found = 0;
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                if above[k] != above[(k + 1) % 3] && found < 2 {
                    let (a, b) = (a.min(b), a.max(b));
                    ends[found] = *numbers.entry([a, b]).or_insert_with(|| {
                        let (h, k) = (height[a as usize], height[b as usize]);
                        crossings.push(self.points[a as usize].lerp(self.points[b as usize], h / (h - k)));
                        crossings.len() - 1
                    });
                    found += 1;
                }
            }
            if found == 2 {
                pairs.push(ends);
            }
        }
        let mut parts = UnionFind::new(crossings.len());
        for [a, b] in pairs {
            parts.join(a as u32, b as u32);
        }
        let (part, count) = parts.numbered();
        let mut loops = vec![Vec::new(); count as usize];
        for (point, part) in crossings.into_iter().zip(part) {
            loops[part as usize].push(point);
        }
        loops
    }

    /// Distances along edges from one vertex; infinite in other parts (Dijkstra 1959).
    pub(super) fn distances(&self, from: usize) -> Vec<f64> {
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); self.points.len()];
        for t in &self.triangles {
            for k in 0..3 {
                around[t[k] as usize].extend([t[(k + 1) % 3], t[(k + 2) % 3]]);
            }
        }
        let mut distance = vec![f64::INFINITY; self.points.len()];
        distance[from] = 0.0;
        // Non-negative numbers are in the order of their bits.
        let mut queue = BinaryHeap::from([Reverse((0_u64, from as u32))]);
        while let Some(Reverse((bits, v))) = queue.pop() {
            let d = f64::from_bits(bits);
            if d > distance[v as usize] {
                continue;
            }
            for &w in &around[v as usize] {
                let next = d + self.points[v as usize].distance(self.points[w as usize]);
                if next < distance[w as usize] {
                    distance[w as usize] = next;
                    queue.push(Reverse((next.to_bits(), w)));
                }
            }
        }
        distance
    }
}
