//! Mixtures and coats of models, and models of version 0.6 with two lobes.

use glam::Vec3;

use super::{
    Reader,
    bsdfs::colored,
    document::Node,
    parameters::{Parameters, numbers},
    spectra::Role,
};
use crate::{
    MIN_ALPHA,
    coat::{COAT_IOR, DIELECTRIC},
    error::Result,
    features,
    import::{Value, Width, blend::mixed},
    material::{Distribution, Material, MaterialKind, Principled},
    math::colour::luminance,
};

impl Reader {
    /// Mixture of two models: an opacity if one of them is `null`, else the greater of them if they do
    /// not mix.
    pub(super) fn blend(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let node = parameters.node;
        let [first, second] = parameters.objects("bsdf")?[..] else {
            return Err(node.error("blendbsdf: expected two bsdfs in it"));
        };
        let weight = self.value_or(parameters, "weight", Role::Reflectance, 0.5)?;
        if second.kind() == "null" {
            let mut model = self.model(first)?;
            self.cut(&mut model, node, weight.affine(Vec3::NEG_ONE, Vec3::ONE));
            return Ok(model);
        }
        if first.kind() == "null" {
            let mut model = self.model(second)?;
            self.cut(&mut model, node, weight);
            return Ok(model);
        }
        let pair = [self.model(first)?, self.model(second)?];
        let share = match weight.split() {
            (_, Some(image)) => Value::Image(image),
            (weight, None) => Value::number(luminance(weight).clamp(0.0, 1.0).into()),
        };
        Ok(self.mixed(node, pair, &share))
    }

    /// Mixture of two models; the greater of them if they do not mix.
    fn mixed(&mut self, node: Node<'_>, pair: [Material; 2], share: &Value) -> Material {
        let [first, second] = pair;
        match share {
            Value::Constant(Vec3::ZERO) => return first,
            Value::Constant(Vec3::ONE) => return second,
            _ => {}
        }
        let losses = [features::MI_BLEND_LOBES, features::MI_BLEND];
        let (material, loss) = mixed([first, second], share, losses);
        if let Some(loss) = loss {
            self.ignored.add(loss, || node.place());
        }
        material
    }

    /// Mixture of models by weights, of version 0.6.
    pub(super) fn mixture(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let node = parameters.node;
        let weights = numbers(node, parameters.string("weights")?.unwrap_or_default())?;
        let models = parameters.objects("bsdf")?;
        if models.is_empty() || weights.len() != models.len() {
            return Err(node.error("mixturebsdf: expected as many `weights` as bsdfs in it"));
        }
        let (mut sum, mut mixed) = (0.0, None);
        for (model, weight) in models.into_iter().zip(weights) {
            let model = self.model(model)?;
            sum += weight.max(0.0);
            let share = if sum > 0.0 { weight.max(0.0) / sum } else { 0.0 };
            mixed = Some(match mixed {
                None => model,
                Some(before) => self.mixed(node, [before, model], &Value::number(share)),
            });
        }
        if (sum - 1.0).abs() > 1e-3 {
            self.ignored.add(features::MI_WEIGHTS, || node.place());
        }
        mixed.ok_or_else(|| node.error("mixturebsdf: expected bsdfs in it"))
    }

    /// Coat of version 0.6 on another model: a plastic on a diffuse one, a coated material on metal.
    pub(super) fn coating(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let mut model = self.inner(parameters)?;
        let width = if parameters.node.kind() == "coating" {
            Width::round(MIN_ALPHA, None)
        } else {
            self.round_width(parameters)?
        };
        let ior = self.ior(parameters, "bk7")?;
        let distributions = [width.distribution, model.surface.distribution];
        model.surface.distribution = width.distribution;
        let coated = |reflectance, alpha| {
            let metal = Principled::coated_metal(reflectance, alpha, width.mean_roughness());
            MaterialKind::Principled(metal)
        };
        match model.kind {
            MaterialKind::Diffuse { reflectance } if (COAT_IOR.0..=COAT_IOR.1).contains(&ior) => {
                let alpha = width.alpha;
                model.kind = MaterialKind::Plastic { diffuse: reflectance, alpha, ior };
                model.surface.roughness = width.texture;
            }
            MaterialKind::Conductor { alpha, fresnel } => {
                model.kind = coated(fresnel.at_normal_incidence(), alpha);
            }
            MaterialKind::Mirror { reflectance } => model.kind = coated(reflectance, 0.0),
            _ => self.ignored.add(features::MI_COATING, || parameters.node.place()),
        }
        if let MaterialKind::Principled(_) = model.kind {
            model.surface.distribution = Distribution::Ggx;
            if distributions.contains(&Distribution::Beckmann) {
                self.ignored.add(features::MI_DISTRIBUTION, || parameters.node.place());
            }
        }
        Ok(model)
    }

    /// Models of version 0.6 with a diffuse and a glossy lobe of given colours, as a metallic-roughness
    /// material.
    pub(super) fn phong(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let node = parameters.node;
        self.ignored.add(features::MI_PHONG, || node.place());
        let Width { alpha, anisotropy, .. } = if node.kind() == "ward" {
            parameters.without_effect("variant");
            self.width_of(parameters)?
        } else {
            let exponent = self.value_or(parameters, "exponent", Role::Index, 30.0)?;
            let exponent = exponent.mean().x.max(0.0);
            // A cosine power about the mirror direction is one of four times it about the normal.
            Width::round((2.0 / (4.0 * exponent + 2.0)).sqrt(), None)
        };
        let diffuse = self.value_or(parameters, "diffuse_reflectance", Role::Reflectance, 0.5)?;
        let specular = self.value_or(parameters, "specular_reflectance", Role::Reflectance, 0.2)?;
        let specular = specular.mean();
        // The coat takes its light from below, which these models do not.
        let base = 1.0 - specular.max_element().min(0.99);
        let diffuse = diffuse.mapped(|share| (share / base).min(1.0));
        let (roughness, metallic) = (alpha.clamp(MIN_ALPHA, 1.0).sqrt(), 0.0);
        let specular_color = specular / DIELECTRIC;
        let rest = Principled { metallic, roughness, specular_color, ..Principled::default() };
        let mut model = colored(diffuse, |base_color| {
            MaterialKind::Principled(Principled { base_color, ..rest })
        });
        model.surface.anisotropy = anisotropy;
        Ok(model)
    }
}
