//! Tensor files, and measurements of GGX surfaces in the parameterisation of Dupuy & Jakob 2018.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec3, dvec3};

/// Columns and rows of the pictures and densities.
const SIDE: usize = 24;
/// Measured polar angles.
const POLAR: usize = 12;

/// Field of a file: name, type (1 is a byte, 10 a 32-bit float), shape, values in bytes.
pub type Field = (&'static str, u8, Vec<usize>, Vec<u8>);

/// Encodes a field of floats.
pub fn floats(name: &'static str, shape: &[usize], values: &[f64]) -> Field {
    let bytes = values.iter().flat_map(|value| (*value as f32).to_le_bytes()).collect();
    (name, 10, shape.to_vec(), bytes)
}

/// Encodes a file.
pub fn encode(fields: &[Field]) -> Vec<u8> {
    let mut head = b"tensor_file\0\x01\0".to_vec();
    head.extend((fields.len() as u32).to_le_bytes());
    let lengths = fields.iter().map(|(name, _, shape, _)| 13 + name.len() + 8 * shape.len());
    let mut offset = head.len() + lengths.sum::<usize>();
    for (name, kind, shape, bytes) in fields {
        head.extend((name.len() as u16).to_le_bytes());
        head.extend(name.bytes());
        head.extend((shape.len() as u16).to_le_bytes());
        head.push(*kind);
        head.extend((offset as u64).to_le_bytes());
        shape.iter().for_each(|length| head.extend((*length as u64).to_le_bytes()));
        offset += bytes.len();
    }
    fields.iter().for_each(|field| head.extend(&field.3));
    head
}

/// Unit vector of polar angle and azimuth.
pub fn direction(theta: f64, phi: f64) -> DVec3 {
    dvec3(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

/// GGX of one width along x and another along y, over a diffuse base, no light lost to masking within.
#[derive(Clone, Copy)]
pub struct Ggx {
    pub alpha: [f64; 2],
    pub reflectance: DVec3,
    pub diffuse: DVec3,
}

impl Ggx {
    fn normals(self, m: DVec3) -> f64 {
        let [x, y] = self.alpha;
        let squared = (m.x / x).powi(2) + (m.y / y).powi(2) + m.z * m.z;
        (PI * x * y * squared * squared).recip()
    }

    fn lambda(self, w: DVec3) -> f64 {
        let [x, y] = self.alpha;
        let slope = ((x * w.x).powi(2) + (y * w.y).powi(2)) / (w.z * w.z);
        0.5 * ((1.0 + slope).sqrt() - 1.0)
    }

    /// f·cosθ_o, 1/sr; 0 below the surface.
    pub fn reflected(self, wi: DVec3, wo: DVec3) -> DVec3 {
        if wo.z <= 0.0 {
            return DVec3::ZERO;
        }
        let m = (wi + wo).normalize();
        let lobe = self.normals(m) / (1.0 + self.lambda(wi) + self.lambda(wo)) / (4.0 * wi.z);
        self.reflectance * lobe + self.diffuse * (wo.z / PI)
    }
}

/// Measures a surface at azimuths `phi`, in radians; `spectrum` makes values at its wavelengths, in nm, of
/// a colour. The density of normals is (1 + x)(2 − y) in all directions, whose inverse is known.
pub fn measured(
    ggx: Ggx,
    phi: &[f64],
    wavelengths: Option<&[f64]>,
    spectrum: impl Fn(DVec3) -> Vec<f64>,
) -> Vec<Field> {
    let node = |index: usize, count: usize| index as f64 / (count - 1) as f64;
    let grid = |value: &dyn Fn(f64, f64) -> f64, [columns, rows]: [usize; 2]| -> Vec<f64> {
        let nodes = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
        nodes.map(|(column, row)| value(node(column, columns), node(row, rows))).collect()
    };
    // Two rows suffice where the azimuth changes nothing.
    let size = if phi.len() == 1 { [128, 2] } else { [128, 65] };
    let angles = |x: f64, y: f64| direction(x * x * FRAC_PI_2, (2.0 * y - 1.0) * PI);
    let area = |w: DVec3| w.z * (1.0 + ggx.lambda(w));
    let ndf = grid(&|x, y| ggx.normals(angles(x, y)), size);
    let sigma = grid(&|x, y| area(angles(x.min(0.999), y)), size);
    let theta: Vec<f64> = (0..POLAR).map(|index| 1.45 * node(index, POLAR)).collect();
    let channels = spectrum(DVec3::ONE).len();
    let mut pictures = Vec::new();
    for &phi_i in phi {
        for &theta_i in &theta {
            let wi = direction(theta_i, phi_i);
            let turn = if phi.len() == 1 { phi_i } else { 0.0 };
            let color = |u: f64, v: f64| {
                let x = (1.0 + 3.0 * u).sqrt() - 1.0;
                let y = 2.0 - (4.0 - 3.0 * v).sqrt();
                let m = direction(x * x * FRAC_PI_2, (2.0 * y - 1.0) * PI + turn);
                let wo = 2.0 * wi.dot(m) * m - wi;
                ggx.reflected(wi, wo) * (4.0 * area(wi) / ggx.normals(m))
            };
            for channel in 0..channels {
                pictures.extend(grid(&|u, v| spectrum(color(u, v))[channel], [SIDE; 2]));
            }
        }
    }
    let density = grid(&|x, y| (1.0 + x) * (2.0 - y), [SIDE; 2]).repeat(phi.len() * POLAR);
    let directions = [phi.len(), POLAR, SIDE, SIDE];
    let picture_shape = [phi.len(), POLAR, channels, SIDE, SIDE];
    let mut fields = vec![
        ("description", 1, vec![4], b"GGX.".to_vec()),
        floats("theta_i", &[POLAR], &theta),
        floats("phi_i", &[phi.len()], phi),
        floats("ndf", &[size[1], size[0]], &ndf),
        floats("sigma", &[size[1], size[0]], &sigma),
        floats("vndf", &directions, &density),
        floats("luminance", &directions, &density),
        floats(if wavelengths.is_some() { "spectra" } else { "rgb" }, &picture_shape, &pictures),
        ("jacobian", 1, vec![1], vec![1]),
    ];
    fields.extend(wavelengths.map(|nm| floats("wavelengths", &[nm.len()], nm)));
    fields
}

/// Measures a surface at one azimuth, in red, green and blue.
pub fn isotropic(alpha: f64) -> (Ggx, Vec<Field>) {
    let (reflectance, diffuse) = (dvec3(0.6, 0.4, 0.2), dvec3(0.1, 0.2, 0.3));
    let ggx = Ggx { alpha: [alpha; 2], reflectance, diffuse };
    (ggx, measured(ggx, &[0.0], None, |color| color.to_array().to_vec()))
}

/// Measures a brushed surface over half a turn, in red, green and blue.
pub fn brushed() -> (Ggx, Vec<Field>) {
    let (reflectance, diffuse) = (dvec3(0.6, 0.4, 0.2), dvec3(0.1, 0.2, 0.3));
    let ggx = Ggx { alpha: [0.3, 0.6], reflectance, diffuse };
    let phi: Vec<f64> = (0..13).map(|index| -PI + TAU / 2.0 * f64::from(index) / 12.0).collect();
    (ggx, measured(ggx, &phi, None, |color| color.to_array().to_vec()))
}
