//! Unknowns of a mesh: one row for each place that vertices are at.

use glam::DVec3;

/// A row for each vertex; those at the same place share one.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    row: Vec<u32>,
    first: Vec<u32>,
}

impl Rows {
    /// From the first vertex at the place of each, see [`welded`](crate::points::welded).
    pub(crate) fn new(place: &[u32]) -> Self {
        let (mut row, mut first) = (vec![0; place.len()], Vec::new());
        for (v, &at) in place.iter().enumerate() {
            row[v] = if at as usize == v {
                first.push(at);
                first.len() as u32 - 1
            } else {
                row[at as usize]
            };
        }
        Self { row, first }
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.first.len()
    }

    /// How many vertices have one.
    pub(crate) fn vertices(&self) -> usize {
        self.row.len()
    }

    /// Those of a triangle's corners.
    pub(crate) fn of(&self, triangle: [u32; 3]) -> [u32; 3] {
        triangle.map(|v| self.row[v as usize])
    }

    /// The positions of the first vertices.
    pub(crate) fn gathered(&self, points: &[DVec3]) -> Vec<DVec3> {
        self.first.iter().map(|&v| points[v as usize]).collect()
    }

    /// What belongs to each vertex's row.
    pub(crate) fn spread(&self, values: &[DVec3]) -> Vec<DVec3> {
        self.row.iter().map(|&row| values[row as usize]).collect()
    }
}
