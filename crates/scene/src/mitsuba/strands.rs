//! Curves of the files of `bsplinecurve`, `linearcurve` and `hair`.

use glam::{DMat4, DVec3, DVec4};

use super::{Reader, parameters::Parameters};
use crate::{
    error::{Error, Result},
    features, files,
    mesh::Mesh,
    strands::{Basis, Detail},
};

const BINARY_HAIR: &[u8] = b"BINARY_HAIR";

impl Reader {
    /// Reads the strands of a shape into the world; radii are lengths there.
    pub(super) fn strands(&mut self, parameters: &Parameters<'_>, to_world: DMat4) -> Result<Mesh> {
        let node = parameters.node;
        let name = parameters.required("filename", parameters.string("filename")?)?;
        let path = node.file(name)?;
        let basis = if node.kind() == "bsplinecurve" { Basis::Spline(3) } else { Basis::Linear };
        let radius = match node.kind() {
            "hair" => Some(f64::from(parameters.float("radius")?.unwrap_or(0.025))),
            _ => None,
        };
        parameters.without_effect("angle_threshold reduction");
        let bytes = files::read(&path)?;
        let strands = match (bytes.strip_prefix(BINARY_HAIR), radius) {
            (Some(bytes), Some(radius)) => binary(bytes, radius),
            _ => text(&bytes, radius),
        };
        let strands = strands.map_err(|message| Error::format(&path, message))?;
        self.inputs.push(path);
        let spans = strands.iter().filter_map(|strand| basis.spans(strand.len())).sum();
        let mut detail = Detail::of(spans);
        let mut mesh = Mesh::default();
        for strand in strands {
            let placed: Vec<_> = strand
                .iter()
                .map(|point| to_world.transform_point3(point.truncate()).extend(point.w))
                .collect();
            detail.add(&mut mesh, basis, &placed);
        }
        self.ignored.add(features::MI_CURVE, || match detail.step {
            1 => node.place(),
            step => format!("{}; one of {step} strands, thicker by as much", node.place()),
        });
        Ok(mesh)
    }
}

/// Reads a point a line; an empty line ends a strand.
fn text(bytes: &[u8], radius: Option<f64>) -> Result<Vec<Vec<DVec4>>, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "not a text file of curves".to_owned())?;
    let mut strands = vec![Vec::new()];
    for (line, words) in text.lines().enumerate() {
        let numbers: Result<Vec<f64>, _> = words.split_ascii_whitespace().map(str::parse).collect();
        let point = match (numbers.as_deref(), radius) {
            (Ok(&[x, y, z]), Some(radius)) => DVec4::new(x, y, z, radius),
            (Ok(&[x, y, z, radius]), None) => DVec4::new(x, y, z, radius),
            _ if words.trim().is_empty() => {
                strands.push(Vec::new());
                continue;
            }
            _ => {
                let expected = if radius.is_some() { "x y z" } else { "x y z radius" };
                return Err(format!("line {}: expected {expected}, found `{words:.60}`", line + 1));
            }
        };
        if let Some(strand) = strands.last_mut() {
            strand.push(point);
        }
    }
    Ok(strands)
}

/// Reads a count and the points, of which one after an infinity begins a strand.
fn binary(bytes: &[u8], radius: f64) -> Result<Vec<Vec<DVec4>>, String> {
    let truncated = || "the file is truncated".to_owned();
    let (count, bytes) = bytes.split_first_chunk().ok_or_else(truncated)?;
    let mut numbers = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
    let mut strands = vec![Vec::new()];
    for _ in 0..u32::from_le_bytes(*count) {
        let mut next = || numbers.next().map(f64::from).ok_or_else(truncated);
        let mut x = next()?;
        if x.is_infinite() {
            strands.push(Vec::new());
            x = next()?;
        }
        let point = DVec3::new(x, next()?, next()?);
        if let Some(strand) = strands.last_mut() {
            strand.push(point.extend(radius));
        }
    }
    Ok(strands)
}
