//! Bilinear functions on the unit square, and densities among them with the integrals that invert their
//! samples.

/// Place in a grid: the node before it, and how far it is from there, 0…1.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    pub(super) column: usize,
    pub(super) row: usize,
    pub(super) x: f64,
    pub(super) y: f64,
}

impl Cell {
    /// Finds a place of the unit square in a grid of two or more columns and rows.
    pub(super) fn new([x, y]: [f64; 2], [columns, rows]: [usize; 2]) -> Self {
        let along = |position: f64, nodes: usize| {
            let position = position.clamp(0.0, 1.0) * (nodes - 1) as f64;
            let node = (position as usize).min(nodes - 2);
            (node, position - node as f64)
        };
        let ((column, x), (row, y)) = (along(x, columns), along(y, rows));
        Self { column, row, x, y }
    }

    /// The four nodes around, by index and weight, those of the next row last.
    pub(super) fn nodes(self, columns: usize) -> [(usize, f64); 4] {
        let Self { column, row, x, y } = self;
        let first = row * columns + column;
        [
            (first, (1.0 - x) * (1.0 - y)),
            (first + 1, x * (1.0 - y)),
            (first + columns, (1.0 - x) * y),
            (first + columns + 1, x * y),
        ]
    }
}

/// Values at the nodes of a regular grid.
pub(super) struct Grid {
    pub(super) values: Vec<f32>,
    /// Columns and rows.
    pub(super) size: [usize; 2],
}

impl Grid {
    pub(super) fn at(&self, place: [f64; 2]) -> f64 {
        let nodes = Cell::new(place, self.size).nodes(self.size[0]);
        nodes.map(|(node, weight)| weight * f64::from(self.values[node])).iter().sum()
    }
}

/// Density of integral 1 over the nodes' unit steps, with its integrals up to each node.
pub(super) struct Density {
    values: Vec<f32>,
    /// Along each row up to a column.
    along: Vec<f32>,
    /// Over the rows up to a row.
    up_to: Vec<f32>,
}

impl Density {
    /// Scales values at the nodes; `None` if all are 0.
    pub(super) fn new(values: &[f32], columns: usize) -> Option<Self> {
        let mut along = vec![0.0_f64; values.len()];
        let mut up_to = vec![0.0_f64; values.len() / columns];
        for row in 0..up_to.len() {
            let first = row * columns;
            for node in first + 1..first + columns {
                let both = f64::from(values[node - 1]) + f64::from(values[node]);
                along[node] = along[node - 1] + 0.5 * both;
            }
            if row > 0 {
                let both = along[first - 1] + along[first + columns - 1];
                up_to[row] = up_to[row - 1] + 0.5 * both;
            }
        }
        let scale = up_to.last().filter(|total| **total > 0.0)?.recip();
        let scaled = |values: &[f64]| values.iter().map(|value| (value * scale) as f32).collect();
        let values = values.iter().map(|value| (f64::from(*value) * scale) as f32).collect();
        Some(Self { values, along: scaled(&along), up_to: scaled(&up_to) })
    }
}

/// Random numbers of which a mixture of densities makes a place: the share of the row there up to the
/// place, and the share of the rows below. `mixed` adds up a number of each density by its weight.
pub(super) fn invert(
    place: [f64; 2],
    [columns, rows]: [usize; 2],
    mixed: impl Fn(&dyn Fn(&Density) -> f32) -> f64,
) -> [f64; 2] {
    let cell = Cell::new(place, [columns, rows]);
    let mix = |low: f64, high: f64, share: f64| low + share * (high - low);
    // Integral from a node to a share of the way to the next.
    let part = |low: f64, high: f64, share: f64| share * mix(low, high, 0.5 * share);
    let nodes = cell.nodes(columns).map(|(node, _)| node);
    let value = nodes.map(|node| mixed(&|density| density.values[node]));
    let along = |node: usize| mixed(&|density| density.along[node]);
    let before = mix(along(nodes[0]), along(nodes[2]), cell.y);
    let ends = [cell.row + 1, cell.row + 2].map(|next| along(next * columns - 1));
    let row = mix(ends[0], ends[1], cell.y);
    let [low, high] = [0, 1].map(|side| mix(value[side], value[side + 2], cell.y));
    let below = mixed(&|density| density.up_to[cell.row]);
    [
        if row > 0.0 { (before + part(low, high, cell.x)) / row } else { 0.0 },
        below + part(ends[0], ends[1], cell.y),
    ]
}
