//! Colour of a diffuse base below a smooth coat, for formats that let light bounce between both.

/// Reflectance of a dielectric of refractive index `ior` ≥ 1 seen from outside; exact Fresnel.
pub fn fresnel_dielectric(cosine: f32, ior: f32) -> f32 {
    let g = (ior * ior - 1.0 + cosine * cosine).max(0.0).sqrt();
    let difference = (ior * ior - 1.0) / (g + cosine);
    let perpendicular = difference / (g + cosine);
    let ratio = (cosine * (g + cosine) - 1.0) / (cosine * difference + 1.0);
    (0.5 * perpendicular * perpendicular * (1.0 + ratio * ratio)).min(1.0)
}

/// The same at normal incidence.
pub(crate) fn normal_reflectance(ior: f32) -> f32 {
    let ratio = (ior - 1.0) / (ior + 1.0);
    ratio * ratio
}

/// Share of diffuse light below an interface of refractive index `ior` that it throws back:
/// 1 − (1 − Fd)/ior², where Fd is the share thrown back of diffuse light from above.
fn internal_reflectance(ior: f32) -> f32 {
    const STEPS: u32 = 256;
    // Fd = ∫ F(μ) 2μ dμ by midpoints.
    let reflected: f32 = (0..STEPS)
        .map(|step| {
            let cosine = (step as f32 + 0.5) / STEPS as f32;
            2.0 * cosine * fresnel_dielectric(cosine, ior) / STEPS as f32
        })
        .sum();
    1.0 - (1.0 - reflected) / (ior * ior)
}

/// Returns the albedo with which a plastic, whose base loses no light below the coat, shows a base of
/// albedo `albedo` that the coat throws back at itself: ρ(1 − Fi)/(1 − ρ Fi). White stays white, and
/// colours deepen. Mitsuba's `nonlinear` plastics and pbrt's `coateddiffuse` are of this kind.
pub fn albedo_below_coat(ior: f32) -> impl Fn(f32) -> f32 {
    let inside = internal_reflectance(ior);
    move |albedo| {
        let albedo = albedo.clamp(0.0, 1.0);
        albedo * (1.0 - inside) / (1.0 - albedo * inside)
    }
}

/// Returns the albedo of the base that [`albedo_below_coat`] shows as `albedo`, its inverse.
pub fn base_below_coat(ior: f32) -> impl Fn(f32) -> f32 {
    let inside = internal_reflectance(ior);
    move |albedo| {
        let albedo = albedo.clamp(0.0, 1.0);
        albedo / (1.0 - inside + albedo * inside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inside_of_glass_throws_back_three_fifths() {
        // Egan & Hilgeman 1973: 0.5963 at 1.5.
        assert!((internal_reflectance(1.5) - 0.5963).abs() < 1e-3);
        assert!(internal_reflectance(1.0).abs() < 1e-3);
    }

    #[test]
    fn colours_deepen_and_white_stays() {
        let below = albedo_below_coat(1.5);
        assert_eq!((below(0.0), below(1.0)), (0.0, 1.0));
        // The series of bounces: ρ T Σ (ρ Fi)ⁿ, with T = 1 − Fi.
        let series: f32 = (0..200).map(|n| 0.5 * 0.4037 * (0.5 * 0.5963_f32).powi(n)).sum();
        assert!((below(0.5) - series).abs() < 1e-3, "{} and {series}", below(0.5));
        let base = base_below_coat(1.5);
        assert!([0.0, 0.3, 1.0].iter().all(|&albedo| (base(below(albedo)) - albedo).abs() < 1e-6));
    }
}
