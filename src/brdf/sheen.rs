//! Twin of `glsl/include/sheen.glsl`: same names, same order. Sheen of cloth by `KHR_materials_sheen`: fibres
//! by Charlie's distribution, with its masking \[Estevez & Kulla 2017\].

use std::f32::consts::PI;

use glam::{Vec2, Vec3, vec3};

use crate::scene::measured::lookup::mix;

/// Smallest width α of a sheen, below which its rim is too narrow for a pixel.
pub(super) const SMALLEST_SHEEN_ALPHA: f32 = 0.01;

/// Logarithm of masking as they fit it, for cosines of 0 to 1/2.
fn sheen_fit(cosine: f32, alpha: f32) -> f32 {
    let gloss = (1.0 - alpha) * (1.0 - alpha);
    let a = mix(21.5473, 25.3245, gloss);
    let b = mix(3.82987, 3.32435, gloss);
    let c = mix(0.19823, 0.16801, gloss);
    let d = mix(-1.97760, -1.27393, gloss);
    let e = mix(-4.32054, -4.85967, gloss);
    a / (1.0 + b * cosine.powf(c)) + d * cosine + e
}

fn sheen_lambda(cosine: f32, alpha: f32) -> f32 {
    let logarithm = if cosine < 0.5 {
        sheen_fit(cosine, alpha)
    } else {
        2.0 * sheen_fit(0.5, alpha) - sheen_fit(1.0 - cosine, alpha)
    };
    logarithm.exp()
}

/// Value of a white sheen, 1/sr, for a half vector of any length.
pub(super) fn sheen_value(
    half_vector: Vec3,
    outgoing_cosine: f32,
    incident_cosine: f32,
    alpha: f32,
) -> f32 {
    let squared_sine = half_vector.truncate().length_squared() / half_vector.length_squared();
    let inverse = alpha.recip();
    let density = (2.0 + inverse) * squared_sine.powf(0.5 * inverse) / (2.0 * PI);
    let masking = 1.0 + sheen_lambda(outgoing_cosine, alpha) + sheen_lambda(incident_cosine, alpha);
    density * (4.0 * masking * outgoing_cosine * incident_cosine).recip().min(1.0)
}

/// Samples a direction with density 1/2π, as `glsl/include/brdf.glsl` does.
pub fn sample_uniform_hemisphere(u: Vec2) -> Vec3 {
    let radius = (u.x * (2.0 - u.x)).sqrt();
    let azimuth = 2.0 * PI * u.y;
    vec3(radius * azimuth.cos(), radius * azimuth.sin(), 1.0 - u.x)
}
