//! Twin of `glsl/include/specular.glsl` and of what it alone needs of `ggx.glsl`: same names, same order.
//! Mirrors, dielectrics and thin panes: materials at which paths go on in a sampled direction, and no sampler
//! draws light; `sample_lamps` does where they are rough.
//!
//! Directions are unit vectors in the shading frame, whose z points to the side of the viewer, and
//! point away from the surface: transmitted ones have z < 0. Values are per steradian without the
//! cosine.
//!
//! Values are for radiance on its way to the viewer, as in pbrt and Mitsuba: light that comes through
//! an interface is scaled by (index of the viewer's side / index of the light's side)², so that light
//! that goes in and out again has its former radiance. Values of importance would lack this factor.

pub use fenestra::brdf::fresnel::{
    fresnel_interface, pane_reflectance, pane_share, pane_transmittance,
};
use fenestra::{
    brdf::{fresnel::refracted_cosine, ggx::*},
    math::colour::luminance,
    shader::{constants::*, structs::Material},
};
use glam::{Vec3, vec2, vec3};

/// Density of all visible normals, per steradian, over the cosine of outgoing direction and normal:
/// G₁·D/cosθ_o. \[Heitz 2014\] Eq. 21.
fn ggx_visible_density(normal: Vec3, outgoing_local: Vec3, width: GgxWidth) -> f32 {
    2.0 * ggx_normal_density(normal, width)
        / (outgoing_local.z + ggx_stretched_length(outgoing_local, width))
}

/// D·G₂ of both directions over GGX's D·G₁ of the outgoing one; height-correlated on one side, and the same
/// expression where the other direction is below the surface. 0…1 for GGX.
fn visible_normal_ratio(
    normal: Vec3,
    outgoing_local: Vec3,
    incident_local: Vec3,
    width: GgxWidth,
) -> f32 {
    let cosine = incident_local.z.abs();
    let visible = (outgoing_local.z + ggx_stretched_length(outgoing_local, width)) * cosine
        / (masked_length(outgoing_local, width) * cosine
            + outgoing_local.z * masked_length(incident_local, width));
    if width.is_beckmann { visible * beckmann_ratio(normal, width) } else { visible }
}

/// Continuation of a path; a weight of 0 ends it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Next direction.
    pub direction_local: Vec3,
    /// Value · |cosine| / density.
    pub weight: Vec3,
    /// True if the direction is on the other side.
    pub is_transmitted: bool,
}

/// Refractive index of the side that the viewer does not see over that of the viewer's; 1 beyond a pane.
pub fn relative_index(material: &Material, is_back: bool) -> f32 {
    match (material.kind, is_back) {
        (MATERIAL_ROUGH_PANE, _) => 1.0,
        (_, true) => 1.0 / material.ior,
        (_, false) => material.ior,
    }
}

/// Light that an interface or a pane reflects at a cosine with the normal of a microfacet.
fn facet_reflectance(material: &Material, cosine: f32, eta: f32) -> f32 {
    match material.kind {
        MATERIAL_ROUGH_PANE => pane_share(material, cosine),
        _ => fresnel_interface(cosine, eta),
    }
}

/// Mirrors a direction at the surface.
fn mirrored(direction: Vec3) -> Vec3 {
    vec3(direction.x, direction.y, -direction.z)
}

/// Probability of reflection: its part of all light by luminance.
fn reflection_probability(material: &Material, fresnel: f32) -> f32 {
    let reflected = fresnel * luminance(material.reflectance.into());
    let sum = reflected + (1.0 - fresnel) * luminance(material.eta.into());
    if sum > 0.0 { reflected / sum } else { 1.0 }
}

/// Refracts at a normal.
fn refracted(outgoing_local: Vec3, normal: Vec3, eta: f32) -> Vec3 {
    let cosine = outgoing_local.dot(normal);
    (cosine / eta - refracted_cosine(cosine, eta)) * normal - outgoing_local / eta
}

/// Interface of a dielectric: smooth at alpha = 0, else by GGX's visible normals. \[Walter et al. 2007\].
fn dielectric_scatter(
    material: &Material,
    outgoing_local: Vec3,
    is_back: bool,
    u: Vec3,
) -> Scatter {
    let eta = relative_index(material, is_back);
    let mut normal = Vec3::Z;
    let width = GgxWidth::of(material);
    if material.alpha > 0.0 {
        normal = ggx_normal_sample(outgoing_local, width, 1.0, vec2(u.y, u.z));
    }
    let cosine = outgoing_local.dot(normal);
    let fresnel = facet_reflectance(material, cosine, eta);
    let probability = reflection_probability(material, fresnel);
    let is_transmitted = u.x >= probability;
    let reflected = 2.0 * cosine * normal - outgoing_local;
    let (direction_local, mut weight) = if is_transmitted {
        let is_pane = material.kind == MATERIAL_ROUGH_PANE;
        (
            if is_pane { mirrored(reflected) } else { refracted(outgoing_local, normal, eta) },
            (1.0 - fresnel) / ((1.0 - probability) * eta * eta) * Vec3::from(material.eta),
        )
    } else {
        (reflected, fresnel / probability * Vec3::from(material.reflectance))
    };
    if material.alpha > 0.0 {
        weight *= visible_normal_ratio(normal, outgoing_local, direction_local, width);
    }
    // A normal may send light to the wrong side of the surface: no sample.
    if cosine <= 0.0 || (direction_local.z < 0.0) != is_transmitted {
        weight = Vec3::ZERO;
    }
    Scatter { direction_local, weight, is_transmitted }
}

/// Value and density of [`scatter`] at a dielectric for one pair of directions; 0 for a smooth one.
pub fn dielectric_evaluate_and_pdf(
    material: &Material,
    outgoing_local: Vec3,
    incident_local: Vec3,
    is_back: bool,
) -> (Vec3, f32) {
    if material.alpha == 0.0 || outgoing_local.z <= 0.0 || incident_local.z == 0.0 {
        return (Vec3::ZERO, 0.0);
    }
    let eta = relative_index(material, is_back);
    let is_transmitted = incident_local.z < 0.0;
    let is_refracted = is_transmitted && material.kind != MATERIAL_ROUGH_PANE;
    let facing =
        if is_transmitted && !is_refracted { mirrored(incident_local) } else { incident_local };
    let half_vector = outgoing_local + (if is_refracted { eta } else { 1.0 }) * facing;
    let normal = (if half_vector.z < 0.0 { -half_vector } else { half_vector }).normalize();
    let cosine = outgoing_local.dot(normal);
    let incident_cosine = facing.dot(normal);
    if cosine <= 0.0 || (incident_cosine < 0.0) != is_refracted {
        return (Vec3::ZERO, 0.0);
    }
    let fresnel = facet_reflectance(material, cosine, eta);
    let probability = reflection_probability(material, fresnel);
    let width = GgxWidth::of(material);
    let density = ggx_visible_density(normal, outgoing_local, width);
    // G₂·D / (cos o · cos i), by the density of visible normals.
    let ratio = visible_normal_ratio(normal, outgoing_local, incident_local, width) * density
        / incident_local.z.abs();
    let (jacobian, scale) = if is_refracted {
        (cosine * incident_cosine.abs() / half_vector.dot(half_vector), eta * eta)
    } else {
        (0.25, 1.0)
    };
    let (share, color, chance) = if is_transmitted {
        (1.0 - fresnel, material.eta, 1.0 - probability)
    } else {
        (fresnel, material.reflectance, probability)
    };
    (share * ratio * jacobian * Vec3::from(color), chance * density * jacobian * scale)
}

/// Share that is left of light which reaches a surface over `distance`: a viewer at the back of a dielectric
/// is inside. Beer and Lambert's law.
pub fn inside_transmittance(material: &Material, is_back: bool, distance: f32) -> Vec3 {
    let is_inside = is_back && material.kind == MATERIAL_DIELECTRIC;
    if is_inside { (-distance * Vec3::from(material.k)).exp() } else { Vec3::ONE }
}

/// Pane: reflects as a mirror or lets light straight through.
fn pane_scatter(material: &Material, outgoing_local: Vec3, u: Vec3) -> Scatter {
    let reflectance = pane_reflectance(material, outgoing_local.z);
    let transmittance = pane_transmittance(material, outgoing_local.z);
    let reflected = luminance(reflectance);
    let sum = reflected + luminance(transmittance);
    let probability = if sum > 0.0 { reflected / sum } else { 1.0 };
    if u.x < probability {
        return Scatter {
            direction_local: vec3(-outgoing_local.x, -outgoing_local.y, outgoing_local.z),
            weight: reflectance / probability,
            is_transmitted: false,
        };
    }
    Scatter {
        direction_local: -outgoing_local,
        weight: transmittance / (1.0 - probability),
        is_transmitted: true,
    }
}

/// Samples the next direction of a path with three numbers in [0, 1). `is_back` tells that the viewer
/// sees the back of the triangles, where the inside of a dielectric is. Materials of other kinds end
/// the path.
pub fn scatter(material: &Material, outgoing_local: Vec3, is_back: bool, u: Vec3) -> Scatter {
    if outgoing_local.z > 0.0 && material.kind == MATERIAL_MIRROR {
        return Scatter {
            direction_local: vec3(-outgoing_local.x, -outgoing_local.y, outgoing_local.z),
            weight: if is_back { material.ior } else { 1.0 } * Vec3::from(material.reflectance),
            is_transmitted: false,
        };
    }
    if outgoing_local.z > 0.0 && matches!(material.kind, MATERIAL_DIELECTRIC | MATERIAL_ROUGH_PANE)
    {
        return dielectric_scatter(material, outgoing_local, is_back, u);
    }
    if outgoing_local.z > 0.0 && material.kind == MATERIAL_THIN_DIELECTRIC {
        return pane_scatter(material, outgoing_local, u);
    }
    Scatter { direction_local: Vec3::Z, weight: Vec3::ZERO, is_transmitted: false }
}
