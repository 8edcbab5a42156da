//! Pictures and numbers of a recorded pixel, for `--pixel` and the window.

use glam::Vec3;
use serde_json::{Value, json};

use super::{
    cell_readback::CellReadback,
    readback::{GuideReadback, GuidedRay},
};
use crate::{
    film::sky::{Sky, white_of},
    pass::{Explanation, RayReadback},
    scene::Scene,
};

/// Names of a cube's faces, in the guide's order.
const FACES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];
/// Tint of regions that a cell has not counted itself, linear.
const UNCOUNTED: Vec3 = Vec3::new(0.35, 0.6, 1.0);

impl Explanation for GuideReadback {
    fn normal(&self) -> Vec3 {
        self.normal
    }

    fn rays(&self) -> Vec<RayReadback> {
        self.rays.iter().map(|ray| ray.ray).collect()
    }

    /// Draws what the cell of the pixel has learned: V̂ of every region, white where all is visible and blue
    /// where only its surroundings have counted, and the density of the shadow rays. Nothing if it has
    /// learned nothing.
    fn skies(&self, scene: &Scene, width: usize) -> Vec<Sky> {
        let Some(cell) = &self.cell else { return Vec::new() };
        let region_of = |direction| self.partition.region_of(&scene.environment, direction);
        let visibility = Sky::new(width, self.normal, 1.0, |direction| {
            let region = cell.regions[region_of(direction)];
            let colour = if region.trials <= 0.0 { UNCOUNTED } else { Vec3::ONE };
            region.visibility as f32 * colour
        });
        let density = |direction| {
            let index = region_of(direction);
            let solid_angle = self.partition.regions[index].solid_angle;
            Vec3::splat((cell.regions[index].probability / solid_angle) as f32)
        };
        let white = white_of(width, density);
        vec![visibility, Sky::new(width, self.normal, white, density)]
    }

    fn numbers(&self) -> Value {
        let known = self.cell.iter().flat_map(|cell| &cell.regions);
        let regions = known.zip(&self.partition.regions).map(|(known, region)| {
            json!({
                "direction": region.direction.to_array(),
                "share": region.share,
                "solid_angle": 4.0 * std::f64::consts::PI * region.solid_angle,
                "trials": known.trials,
                "hits": known.hits,
                "visibility": known.visibility,
                "probability": known.probability,
            })
        });
        json!({
            "position": self.position.to_array(),
            "normal": self.normal.to_array(),
            "rays": self.rays.iter().map(ray_numbers).collect::<Vec<_>>(),
            "cell": self.cell.as_ref().map(cell_numbers),
            "regions": regions.collect::<Vec<_>>(),
        })
    }
}

fn ray_numbers(ray: &GuidedRay) -> Value {
    let mut numbers = ray.ray.numbers();
    numbers["sample"] = json!(ray.sample);
    numbers["region"] = json!(ray.region);
    numbers
}

fn cell_numbers(cell: &CellReadback) -> Value {
    let level = match cell.key {
        None => "face",
        Some(key) if key.is_coarse() => "coarse",
        Some(_) => "fine",
    };
    json!({
        "level": level,
        "key": cell.key.map(|key| key.0),
        "face": FACES.get(cell.face),
        "trials": cell.regions.iter().map(|region| region.trials).sum::<f64>(),
        "hits": cell.regions.iter().map(|region| region.hits).sum::<f64>(),
    })
}
