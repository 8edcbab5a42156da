//! Lamps and the environment.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::triple;
use crate::{
    EnvironmentMap, Lamp,
    error::Result,
    export::folder::Folder,
    lamp::{LampKind, SpotFalloff},
    math::equal_area::direction_from_square,
};

/// Sides of the square map, texels.
const SIDES: (u32, u32) = (64, 4096);
/// Points of a texel of a square map with twice the rows of the other, along each side, whose mean it is.
const POINTS: u32 = 3;

/// Returns the light source of a lamp, and warns where it is not Fenestra's.
pub(super) fn lamp(lamp: &Lamp, warnings: &mut Vec<String>) -> String {
    match lamp.kind {
        LampKind::Point { position, intensity } => format!(
            "LightSource \"point\" \"rgb I\" [{}] \"point3 from\" [{}]\n",
            triple(intensity),
            triple(position)
        ),
        LampKind::Directional { direction, irradiance } => format!(
            "LightSource \"distant\" \"rgb L\" [{}] \"point3 from\" [0 0 0] \"point3 to\" [{}]\n",
            triple(irradiance),
            triple(direction)
        ),
        LampKind::Spot(spot) => {
            if spot.falloff != SpotFalloff::SmoothCosine {
                warnings.push(format!(
                    "lamp `{}`: between its two angles pbrt's spot falls off by 3t² − 2t³, with t \
                     linear in the cosine, Fenestra's by another curve",
                    lamp.name
                ));
            }
            let DVec3 { x, y, z } = spot.position.as_dvec3() + spot.direction.as_dvec3();
            let [inner, outer] = [spot.inner_angle_rad, spot.outer_angle_rad]
                .map(|angle| f64::from(angle).to_degrees());
            format!(
                "LightSource \"spot\" \"rgb I\" [{}] \"point3 from\" [{}]\n    \
                 \"point3 to\" [{x} {y} {z}] \"float coneangle\" {outer} \"float conedeltaangle\" {}\n",
                triple(spot.intensity),
                triple(spot.position),
                outer - inner
            )
        }
    }
}

/// Writes the environment into `folder` and returns its light source; black ones need none.
///
/// A square equal-area map twice as high as the lat-long one has texels smaller than those at its
/// horizon. The directions of the map are those of the world.
pub(super) fn write_environment(map: &EnvironmentMap, folder: &Folder) -> Result<String> {
    if map.is_black() {
        return Ok(String::new());
    }
    if let Some(radiance) = map.uniform_radiance() {
        return Ok(format!("LightSource \"infinite\" \"rgb L\" [{}]\n", triple(radiance)));
    }
    let (side, texels) = equal_area(map);
    let file = folder.write_environment([side; 2], |column, row| texels[row * side + column])?;
    Ok(format!("LightSource \"infinite\" \"string filename\" \"{file}\"\n"))
}

/// Side and rows of the map as an equal-area square, in the directions of the world.
fn equal_area(map: &EnvironmentMap) -> (usize, Vec<Vec3>) {
    let side = map.height.saturating_mul(2).clamp(SIDES.0, SIDES.1);
    let points = POINTS * map.height.saturating_mul(2).div_ceil(side);
    let texel = |index: u32| {
        let corner = Vec2::new((index % side) as f32, (index / side) as f32);
        let point = |index: u32| {
            let inside = Vec2::new((index % points) as f32, (index / points) as f32) + 0.5;
            let place = (corner + inside / points as f32) / side as f32;
            map.radiance(direction_from_square(place))
        };
        let sum: Vec3 = (0..points * points).map(point).sum();
        sum / (points * points) as f32
    };
    (side as usize, (0..side * side).into_par_iter().map(texel).collect())
}
