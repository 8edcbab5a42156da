//! Colour of a diffuse base below a coat, for formats that let light bounce between both or lose some; a
//! diffuse and a specular colour as metallic-roughness.

use glam::{Vec2, Vec3};

use crate::material::Distribution;

/// Refractive indices that a coat may have.
pub(crate) const COAT_IOR: (f32, f32) = (1.01, 4.0);
/// Reflectance at normal incidence of the dielectric of refractive index 1.5.
pub const DIELECTRIC: f32 = 0.04;
/// That index, which materials have that state none.
pub(crate) const DEFAULT_IOR: f32 = 1.5;
const TINY: f32 = 1e-6;

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

/// Rough coat of Mitsuba's `roughplastic`, which loses the light that its microfacets send on to others.
pub(crate) struct LossyCoat {
    /// Albedo of a base of small albedo below the coat, over the share of light that it does not reflect.
    shown: f32,
    /// Share of the base's light that the coat throws back.
    inside: f32,
}

impl LossyCoat {
    /// Elevations at which Mitsuba tabulates its coat.
    const ELEVATIONS: u32 = 32;

    /// Coat of microfacets of width `alpha` and refractive index `ior` > 1.
    pub(crate) fn new(distribution: Distribution, alpha: f32, ior: f32) -> Self {
        let microfacets =
            |ior, cosine, reflects| microfacets(distribution, alpha, ior, cosine, reflects);
        // The means of Mitsuba's tables over equal steps of the cosine.
        let mean = |of: &dyn Fn(f32) -> f32| {
            let cosine = |step: u32| (step as f32 / (Self::ELEVATIONS - 1) as f32).max(1e-6);
            let sum: f32 = (0..Self::ELEVATIONS).map(|step| cosine(step) * of(cosine(step))).sum();
            2.0 * sum / Self::ELEVATIONS as f32
        };
        let inside = mean(&|cosine| microfacets(ior.recip(), cosine, true));
        let through = mean(&|cosine| microfacets(ior, cosine, false));
        let reflected = mean(&|cosine| microfacets(ior, cosine, true));
        Self { shown: through * through / (ior * ior * (1.0 - reflected)), inside }
    }

    /// Returns the albedo with which a lossless plastic shows a base of this one; `deepens` if the base's own
    /// colour counts at each bounce below the coat.
    pub(crate) fn albedo(&self, deepens: bool) -> impl Fn(f32) -> f32 {
        let &Self { shown, inside } = self;
        move |base| {
            let base = base.clamp(0.0, 1.0);
            base * shown / (1.0 - inside * if deepens { base } else { 1.0 })
        }
    }

    /// Factor from the base of a lossless plastic to that of this one, each bounce of which is lossless.
    pub(crate) fn base_factor(&self) -> f32 {
        (1.0 - self.inside) / self.shown
    }
}

/// |cosθ| (1 + 2Λ), by which Beckmann's normals mask a direction, of the cosine and the length of its tangential
/// part stretched by the widths. \[Walter et al. 2007\], the fit below Eq. 27.
pub fn beckmann_length(cosine: f32, tangential: f32) -> f32 {
    let a = cosine / tangential.max(1e-30);
    let masked = tangential * (1.0 - 1.259 * a + 0.396 * a * a) / (3.535 + 2.181 * a);
    if a < 1.6 { cosine + 2.0 * masked } else { cosine }
}

/// Share of light at an elevation that microfacets reflect or refract to where others do not mask it.
fn microfacets(
    distribution: Distribution,
    alpha: f32,
    ior: f32,
    cosine: f32,
    reflects: bool,
) -> f32 {
    const STEPS: u32 = 24;
    let to = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let seen = |direction: Vec3| {
        let cosine = direction.z.abs().max(1e-6);
        let tangential = alpha * direction.truncate().length();
        let length = match distribution {
            Distribution::Ggx => cosine.hypot(tangential),
            Distribution::Beckmann => beckmann_length(cosine, tangential),
        };
        2.0 * cosine / (cosine + length)
    };
    let share = |index: u32| {
        let [polar, turn] =
            [index / STEPS, index % STEPS].map(|step| (step as f32 + 0.5) / STEPS as f32);
        // Steps crowd toward the steep facets, which count most.
        let (below, mut density) = ((1.0 - polar).powi(3), 3.0 * (1.0 - polar).powi(2));
        if distribution == Distribution::Beckmann {
            // Over the density of GGX, by which the points are spread.
            density *= (1.0 - below.recip()).exp() / (below * below);
        }
        let normal_z = (1.0 + alpha * alpha * (1.0 - below) / below).sqrt().recip();
        let sine = (1.0 - normal_z * normal_z).max(0.0).sqrt();
        let way = Vec2::from_angle(std::f32::consts::TAU * turn);
        let normal = (sine * way).extend(normal_z);
        let met = to.dot(normal);
        if met <= 0.0 {
            return 0.0;
        }
        let refracted = 1.0 - (1.0 - met * met) / (ior * ior);
        let fresnel = match refracted {
            ..=0.0 => 1.0,
            _ if ior >= 1.0 => fresnel_dielectric(met, ior),
            inside => fresnel_dielectric(inside.sqrt(), ior.recip()),
        };
        let (away, kept, is_kept) = if reflects {
            let away = 2.0 * met * normal - to;
            (away, fresnel, away.z > 0.0)
        } else {
            let away = (met / ior - refracted.max(0.0).sqrt()) * normal - to / ior;
            (away, 1.0 - fresnel, away.z < 0.0)
        };
        // Facets have the density D cosθ; the visible ones G₁ D (o · m)/o_z.
        if !is_kept {
            return 0.0;
        }
        density * kept * seen(to) * seen(away) * met / (cosine * normal_z)
    };
    (0..STEPS * STEPS).map(share).sum::<f32>() / (STEPS * STEPS) as f32
}

/// Factor from the albedo of the diffuse base of Mitsuba's `principled` to that of glTF's material, which is
/// Lambertian and loses the light that its dielectric of the reflectance `normal` reflects: the ratio of both
/// means over the hemisphere, at 1.5 and roughness 0.2 to 1 within 0.1%.
pub(crate) fn principled_base_factor(roughness: f32, normal: f32) -> f32 {
    (0.9522 + 0.113 * roughness) / (0.9963 * (1.0 - normal)).max(0.1)
}

/// Base colour and share of metal that reflect as a diffuse and a specular colour do, of which the diffuse
/// one counts as far as the specular one leaves light.
pub(crate) fn metallic_roughness(diffuse: Vec3, specular: Vec3) -> (Vec3, f32) {
    let share_below = 1.0 - specular.max_element();
    let metallic = metallic(brightness(diffuse), brightness(specular), share_below);
    let of_diffuse = diffuse * (share_below / (1.0 - DIELECTRIC) / (1.0 - metallic).max(TINY));
    let of_specular = (specular - Vec3::splat(DIELECTRIC * (1.0 - metallic))) / metallic.max(TINY);
    let base = of_diffuse.lerp(of_specular, metallic * metallic);
    (base.clamp(Vec3::ZERO, Vec3::ONE), metallic)
}

/// Share of metal at which the one base colour has the brightness of both; the root of a parabola.
fn metallic(diffuse: f32, specular: f32, share_below: f32) -> f32 {
    if specular < DIELECTRIC {
        return 0.0;
    }
    let b = diffuse * share_below / (1.0 - DIELECTRIC) + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let discriminant = (b * b - 4.0 * DIELECTRIC * c).max(0.0);
    ((discriminant.sqrt() - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

fn brightness(color: Vec3) -> f32 {
    (color * color).dot(Vec3::new(0.299, 0.587, 0.114)).sqrt()
}
