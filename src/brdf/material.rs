//! Validated materials of a scene.

use std::{path::PathBuf, sync::Arc};

use glam::Vec3;

use crate::brdf::table::MeasuredTable;

/// Named surface material; all are two-sided and opaque.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name in the scene file.
    pub name: String,
    /// Reflection model.
    pub kind: MaterialKind,
}

/// Fresnel reflectance of a conductor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConductorFresnel {
    /// Schlick's approximation.
    Schlick {
        /// Reflectance at normal incidence.
        reflectance: Vec3,
    },
    /// Exact Fresnel equations.
    Exact {
        /// Real part of the refractive index per colour channel.
        eta: Vec3,
        /// Extinction coefficient per colour channel.
        k: Vec3,
    },
}

/// Reflection model with its parameters.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// Lambertian: reflectance / π.
    Diffuse {
        /// Albedo, 0…1.
        reflectance: Vec3,
    },
    /// GGX dielectric coat over a diffuse base.
    Plastic {
        /// Albedo of the base, 0…1.
        diffuse: Vec3,
        /// GGX width α.
        alpha: f32,
        /// Refractive index of the coat.
        ior: f32,
    },
    /// GGX microfacet conductor.
    Conductor {
        /// GGX width α.
        alpha: f32,
        /// Fresnel term.
        fresnel: ConductorFresnel,
    },
    /// Tabulated measurement (MERL or Cornell file).
    Measured {
        /// The file.
        path: PathBuf,
        /// Its table on the half/difference grid, shared by materials that name the same file.
        table: Arc<MeasuredTable>,
    },
}
