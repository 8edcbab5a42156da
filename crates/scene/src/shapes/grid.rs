//! `grid`: a sheet over the x-z plane, for cloth, curtains, water and ground.

use glam::{DVec2, DVec3};
use serde::Deserialize;

use super::{Builder, Mesh, Shape, Vertex, count, finite, positive};

/// `grid`: centred on the origin in x and z.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Grid {
    /// Lengths along x and z, metres.
    pub size: [f32; 2],
    /// Thickness of the sheet, half above and half below, metres.
    #[serde(default = "default_thickness")]
    pub thickness: f32,
    /// Cells along x and z.
    #[serde(default = "default_cells")]
    pub cells: [usize; 2],
    /// Heights at points spread evenly over the sheet, metres, joined by a cubic spline: rows from
    /// −z to +z, each from −x to +x. Flat if empty.
    #[serde(default)]
    pub heights: Vec<Vec<f32>>,
    /// Waves added to the heights.
    #[serde(default)]
    pub waves: Vec<Wave>,
}

/// Sine wave of a [`Grid`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wave {
    /// Half the height from trough to crest, metres.
    pub amplitude: f32,
    /// Distance from crest to crest, metres.
    pub wavelength: f32,
    /// Direction of the wave vector, degrees from +x toward +z.
    #[serde(default)]
    pub direction_deg: f32,
    /// Phase, degrees.
    #[serde(default)]
    pub phase_deg: f32,
}

fn default_thickness() -> f32 {
    0.01
}

fn default_cells() -> [usize; 2] {
    [64, 64]
}

impl Shape for Grid {
    fn mesh(&self) -> Result<Mesh, String> {
        let size = DVec2::new(positive("size", self.size[0])?, positive("size", self.size[1])?);
        let half_thickness = 0.5 * positive("thickness", self.thickness)?;
        let columns = count("cells", self.cells[0], 1..=2048)? + 1;
        let rows = count("cells", self.cells[1], 1..=2048)? + 1;
        let width = self.heights.first().map_or(0, Vec::len);
        if !self.heights.is_empty() {
            count("number of rows in heights", self.heights.len(), 2..=1024)?;
            count("number of heights in a row", width, 2..=1024)?;
        }
        for row in &self.heights {
            finite("heights", row)?;
            if row.len() != width {
                let found = row.len();
                return Err(format!("heights: expected rows of {width} numbers, found {found}"));
            }
        }
        for wave in &self.waves {
            positive("wavelength", wave.wavelength)?;
            finite("waves", &[wave.amplitude, wave.direction_deg, wave.phase_deg])?;
        }
        let place = |row: usize, column: usize| {
            let at = DVec2::new(column as f64, row as f64)
                / DVec2::new((columns - 1) as f64, (rows - 1) as f64);
            let step = 1e-4;
            let height = |x: f64, y: f64| self.height(size, DVec2::new(x, y));
            let slope = DVec2::new(
                height(at.x + step, at.y) - height(at.x - step, at.y),
                height(at.x, at.y + step) - height(at.x, at.y - step),
            ) / (2.0 * step * size);
            let flat = (at - 0.5) * size;
            let normal = DVec3::new(-slope.x, 1.0, -slope.y).normalize();
            let position = DVec3::new(flat.x, height(at.x, at.y), flat.y);
            Vertex { position, normal, uv: DVec2::new(at.x, 1.0 - at.y) * size }
        };
        let sheet: Vec<_> =
            (0..rows * columns).map(|index| place(index / columns, index % columns)).collect();
        let side = |row: usize, column: usize, side: f64| {
            let Vertex { position, normal, uv } = sheet[row * columns + column];
            let uv = if side < 0.0 { DVec2::new(size.x - uv.x, uv.y) } else { uv };
            let position = position + side * half_thickness * normal;
            Vertex { position, normal: side * normal, uv }
        };
        let mut builder = Builder::default();
        // Run rows from +z to −z, so that x × rows points up.
        builder.patch(rows, columns, |row, column| side(rows - 1 - row, column, 1.0));
        builder.patch(rows, columns, |row, column| side(row, column, -1.0));
        // Close the rim from bottom to top, walked so that columns × rows points outward.
        let sign = |row: usize| 2.0 * row as f64 - 1.0;
        let rim = |row: usize, column: usize, level: usize, normal: DVec3| {
            let uv = sheet[row * columns + column].uv;
            Vertex { position: side(row, column, sign(level)).position, normal, uv }
        };
        builder.patch(2, columns, |level, step| rim(rows - 1, step, level, DVec3::Z));
        builder.patch(2, columns, |level, step| rim(0, columns - 1 - step, level, DVec3::NEG_Z));
        builder.patch(2, rows, |level, step| rim(rows - 1 - step, columns - 1, level, DVec3::X));
        builder.patch(2, rows, |level, step| rim(step, 0, level, DVec3::NEG_X));
        builder.finish()
    }
}

impl Grid {
    /// Height at a point of the sheet, from (0, 0) to (1, 1).
    fn height(&self, size: DVec2, at: DVec2) -> f64 {
        let from_waves = self.waves.iter().map(|wave| {
            let direction = DVec2::from_angle(f64::from(wave.direction_deg).to_radians());
            let along = ((at - 0.5) * size).dot(direction) / f64::from(wave.wavelength);
            let phase = std::f64::consts::TAU * along + f64::from(wave.phase_deg).to_radians();
            f64::from(wave.amplitude) * phase.sin()
        });
        let from_heights = if self.heights.is_empty() { 0.0 } else { self.spline_height(at) };
        from_heights + from_waves.sum::<f64>()
    }

    fn spline_height(&self, at: DVec2) -> f64 {
        let rows: Vec<f64> = self
            .heights
            .iter()
            .map(|row| spline(at.x, row.len(), |index| f64::from(row[index])))
            .collect();
        spline(at.y, rows.len(), |index| rows[index])
    }
}

/// Uniform Catmull-Rom spline through `count` values spread evenly over 0…1.
fn spline(at: f64, count: usize, value: impl Fn(usize) -> f64) -> f64 {
    let position = at * (count - 1) as f64;
    let span = (position.floor().max(0.0) as usize).min(count - 2);
    let t = position - span as f64;
    let (b, c) = (value(span), value(span + 1));
    let a = if span > 0 { value(span - 1) } else { 2.0 * b - c };
    let d = if span + 2 < count { value(span + 2) } else { 2.0 * c - b };
    b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
}
