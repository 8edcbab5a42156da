//! RGL `.bsdf` files: measurements in an adaptive parameterisation \[Dupuy & Jakob 2018\] →
//! [`AdaptiveBrdf`], which is the file's own interpolation, → [`MeasuredTable`].
//!
//! Angles are numbers of the unit square: √(2θ/π) and (φ + π)/2π. For each of the measured directions
//! (θ_i, φ_i) the file has a density of microfacet normals ω_m over that square, `vndf`, and a picture
//! of colours over the random numbers that the density makes normals of. Reflected light is
//! f·cosθ_o = picture(vndf⁻¹(ω_m)) · D(ω_m) / 4σ(ω_i), with `ndf` for D and
//! `sigma` for the projected area σ. Isotropic files take φ_m relative to φ_i.

use std::{
    f64::consts::{FRAC_PI_2, PI, TAU},
    path::Path,
};

use glam::{DVec2, DVec3, Vec3};

use crate::{
    error::{Error, Result},
    measured::{
        table::{MeasuredTable, RglTraits},
        tensor::TensorFile,
    },
    spectrum,
};

/// Measured BRDF as its file interpolates it.
pub struct AdaptiveBrdf {
    theta: Vec<f32>,
    phi: Vec<f32>,
    ndf: Grid,
    sigma: Grid,
    /// Densities of normals by φ_i, then θ_i.
    slices: Vec<Density>,
    /// Columns and rows of the slices.
    size: [usize; 2],
    /// Pictures in the order of the slices.
    colors: Vec<Vec3>,
    /// Columns and rows of the pictures.
    color_size: [usize; 2],
    /// False if the pictures hold f·cosθ_o itself.
    is_relative: bool,
    /// Signs of x and y that carry directions into the measured part of a symmetric BRDF.
    symmetries: &'static [[f64; 2]],
    /// True if the BRDF depends on the turn of the surface about its normal.
    is_anisotropic: bool,
    /// Parts that the table has no place for.
    pub traits: RglTraits,
    clipped_count: usize,
}

/// Reads a file and bakes [`AdaptiveBrdf::value`] on the half/difference grid.
pub fn load(path: &Path) -> Result<MeasuredTable> {
    let brdf = AdaptiveBrdf::read(path)?;
    let value = |outgoing, incident| brdf.value(outgoing, incident);
    let table = if brdf.is_anisotropic {
        MeasuredTable::tabulate_turns(value)
    } else {
        MeasuredTable::tabulate(value)
    };
    let mut table = table.map_err(|message| Error::format(path, message))?;
    table.warnings.extend(brdf.warnings());
    table.rgl = Some(brdf.traits);
    Ok(table)
}

impl AdaptiveBrdf {
    /// Reads a file.
    ///
    /// # Errors
    /// [`crate::Error::Format`] for a file that is truncated, lacks a field or has one of another type,
    /// shape or range.
    pub fn read(path: &Path) -> Result<Self> {
        let file = TensorFile::read(path)?;
        let (theta, phi) = (rising(&file, "theta_i")?, rising(&file, "phi_i")?);
        let grid = |name: &str| {
            let (values, [rows, columns]) = file.floats(name)?;
            check_grid(&file, name, &values, [columns, rows])?;
            Ok(Grid { values, size: [columns, rows] })
        };
        let (ndf, sigma) = (grid("ndf")?, grid("sigma")?);
        let (values, [of_phi, of_theta, rows, columns]) = file.floats("vndf")?;
        check_grid(&file, "vndf", &values, [columns, rows])?;
        check_directions(&file, "vndf", [of_phi, of_theta], [&phi, &theta])?;
        let slices: Option<_> =
            values.chunks_exact(columns * rows).map(|slice| Density::new(slice, columns)).collect();
        let slices = slices.ok_or_else(|| {
            file.error("field `vndf`: expected a density above 0 for each direction, found 0")
        })?;

        let is_spectral = !file.has("rgb");
        let name = if is_spectral { "spectra" } else { "rgb" };
        let (values, [of_phi, of_theta, channels, color_rows, color_columns]) =
            file.floats(name)?;
        check_directions(&file, name, [of_phi, of_theta], [&phi, &theta])?;
        check_grid(&file, name, &[], [color_columns, color_rows])?;
        let weights = if is_spectral {
            let wavelengths = rising(&file, "wavelengths")?;
            let wavelengths: Vec<f64> = wavelengths.iter().map(|nm| f64::from(*nm)).collect();
            spectrum::srgb_weights(&wavelengths).ok_or_else(|| {
                file.error("field `wavelengths`: expected nm, of which some are visible")
            })?
        } else {
            vec![DVec3::X, DVec3::Y, DVec3::Z]
        };
        if channels != weights.len() {
            return Err(file.error(format!(
                "field `{name}`: expected {} colours or wavelengths, found {channels}",
                weights.len()
            )));
        }
        let mut clipped_count = 0;
        let texels = color_rows * color_columns;
        let mut colors = Vec::with_capacity(values.len() / channels);
        for picture in values.chunks_exact(channels * texels) {
            for texel in 0..texels {
                let channels = picture[texel..].iter().step_by(texels);
                let color: DVec3 =
                    channels.zip(&weights).map(|(value, weight)| *weight * f64::from(*value)).sum();
                clipped_count += usize::from(color.min_element() < 0.0);
                colors.push(color.max(DVec3::ZERO).as_vec3());
            }
        }

        // Two azimuths or fewer are one, as for Mitsuba.
        let is_anisotropic = phi.len() > 2;
        let range = f64::from(phi[phi.len() - 1] - phi[0]);
        let symmetries: &[[f64; 2]] = match (TAU / range).round() as i64 {
            _ if !is_anisotropic => &[[1.0, 1.0]],
            1 => &[[1.0, 1.0]],
            2 => &[[1.0, 1.0], [-1.0, -1.0]],
            4 => &[[1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]],
            _ => {
                return Err(file.error(format!(
                    "field `phi_i`: expected a whole, half or quarter turn, found {:.1}°",
                    range.to_degrees()
                )));
            }
        };
        Ok(Self {
            theta,
            phi,
            ndf,
            sigma,
            slices,
            size: [columns, rows],
            colors,
            color_size: [color_columns, color_rows],
            is_relative: file.flag("jacobian")?,
            symmetries,
            is_anisotropic,
            traits: RglTraits { is_spectral },
            clipped_count,
        })
    }

    /// Parts that [`Self::value`] leaves out, for the log.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.clipped_count > 0 {
            warnings.push(format!(
                "{} of {} colours are beyond Rec.709 or negative; their negative channels were set to 0",
                self.clipped_count,
                self.colors.len()
            ));
        }
        warnings
    }

    /// Value in 1/sr, without the cosine, for the table: reciprocal. The two values of a pair of directions
    /// enter with the cosine that divides them as a weight, so that neither is large where its cosine is
    /// small.
    pub fn value(&self, outgoing: Vec3, incident: Vec3) -> Vec3 {
        let [out, into] = [outgoing, incident].map(Vec3::as_dvec3);
        let both = self.reflected(out, into) + self.reflected(into, out);
        (both / (out.z + into.z)).as_vec3()
    }

    /// Light reflected toward `outgoing` of a unit of radiance per steradian from `incident`, f·cosθ, 1/sr:
    /// `outgoing` is the measurement's ω_i, and the cosine is that of `incident`. 0 unless both are above
    /// the surface.
    pub fn reflected(&self, outgoing: DVec3, incident: DVec3) -> DVec3 {
        if outgoing.z <= 0.0 || incident.z <= 0.0 {
            return DVec3::ZERO;
        }
        // Carry both into the part of the circle that was measured.
        let middle = 0.5 * f64::from(self.phi[0] + self.phi[self.phi.len() - 1]);
        let off_middle = |d: DVec3| (d.y.atan2(d.x) - middle + PI).rem_euclid(TAU) - PI;
        let carried = self.symmetries.iter().map(|&signs| {
            let signs = DVec2::from(signs).extend(1.0);
            (off_middle(signs * outgoing), signs)
        });
        let nearest = carried.min_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let (off_middle, signs) = nearest.unwrap_or((0.0, DVec3::ONE));
        let (outgoing, incident) = (signs * outgoing, signs * incident);

        let angles = |d: DVec3| (d.truncate().length().atan2(d.z), d.y.atan2(d.x));
        let (theta_i, phi_i) = (angles(outgoing).0, middle + off_middle);
        let (theta_m, phi_m) = angles(outgoing + incident);
        let turn = if self.is_anisotropic { 0.0 } else { phi_i };
        let square =
            |theta: f64, phi: f64| [(theta / FRAC_PI_2).sqrt(), ((phi + PI) / TAU).rem_euclid(1.0)];
        let normal = square(theta_m, phi_m - turn);
        let ((row, y), (column, x)) = (interval(&self.phi, phi_i), interval(&self.theta, theta_i));
        let slices = Cell { column, row, x, y }.nodes(self.theta.len());
        let slices = slices.into_iter().filter(|slice| slice.1 > 0.0);
        let mixed = |number: &dyn Fn(&Density) -> f32| -> f64 {
            let weighted = |(slice, weight)| weight * f64::from(number(&self.slices[slice]));
            slices.clone().map(weighted).sum()
        };
        let random_numbers = invert(normal, self.size, mixed);
        let [columns, rows] = self.color_size;
        let nodes = Cell::new(random_numbers, self.color_size).nodes(columns);
        let mut color = DVec3::ZERO;
        for (slice, weight) in slices {
            let picture = &self.colors[slice * columns * rows..][..columns * rows];
            for (node, share) in nodes {
                color += weight * share * picture[node].as_dvec3();
            }
        }
        if !self.is_relative {
            return color;
        }
        let area = self.sigma.at(square(theta_i, phi_i));
        if area > 0.0 { color * self.ndf.at(normal) / (4.0 * area) } else { DVec3::ZERO }
    }
}

/// Node before a value among rising ones, and the share of the way to the next; ends are held.
fn interval(nodes: &[f32], value: f64) -> (usize, f64) {
    let next = nodes.partition_point(|node| f64::from(*node) <= value);
    let node = next.saturating_sub(1).min(nodes.len().saturating_sub(2));
    let low = f64::from(nodes[node]);
    let width = nodes.get(node + 1).map_or(1.0, |high| f64::from(*high) - low);
    (node, if nodes.len() > 1 { ((value - low) / width).clamp(0.0, 1.0) } else { 0.0 })
}

/// Rising numbers of a field.
fn rising(file: &TensorFile<'_>, name: &str) -> Result<Vec<f32>> {
    let (values, [_]) = file.floats(name)?;
    match values.windows(2).find(|pair| pair[0] >= pair[1]) {
        None => Ok(values),
        Some(pair) => {
            let message = format!("expected rising numbers, found {} after {}", pair[1], pair[0]);
            Err(file.error(format!("field `{name}`: {message}")))
        }
    }
}

/// Fails for a grid of fewer than two nodes along an axis, or with a negative value.
fn check_grid(file: &TensorFile<'_>, name: &str, values: &[f32], size: [usize; 2]) -> Result<()> {
    let [columns, rows] = size;
    let message = if columns < 2 || rows < 2 {
        format!("expected a grid of 2 × 2 or more, found {columns} × {rows}")
    } else if let Some(value) = values.iter().find(|value| **value < 0.0) {
        format!("expected no negative number, found {value}")
    } else {
        return Ok(());
    };
    Err(file.error(format!("field `{name}`: {message}")))
}

/// Fails for a field whose first dimensions are not those of the measured directions.
fn check_directions(
    file: &TensorFile<'_>,
    name: &str,
    found: [usize; 2],
    nodes: [&[f32]; 2],
) -> Result<()> {
    let expected = nodes.map(<[f32]>::len);
    if found == expected {
        return Ok(());
    }
    Err(file.error(format!(
        "field `{name}`: expected {} × {} directions as phi_i × theta_i, found {} × {}",
        expected[0], expected[1], found[0], found[1]
    )))
}

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
