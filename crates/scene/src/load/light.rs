//! `[environment]`, `[[lamp]]` and `[[portal]]` → the light of a scene.

use std::path::PathBuf;

use glam::Vec3;

use super::{FINITE, Loader};
use crate::{
    EnvironmentMap, Lamp, MAX_PORTALS, Portal, Scene,
    error::Result,
    file::{Entry, EnvironmentEntry, LampEntry, LampKindEntry, PortalKeys, SceneFile},
    lamp::{LampKind, Spot},
    mesh::label,
};

impl Loader<'_> {
    /// Makes environment, lamps and portals of a scene file, with the options of the command line.
    pub(super) fn light(&self, file: &SceneFile, scene: &mut Scene) -> Result<()> {
        let lamps = file.lamps.iter().enumerate().map(|(index, entry)| self.lamp(index, entry));
        let lamps = lamps.collect::<Result<Vec<_>>>()?;
        // Those of included files come last.
        drop(scene.lamps.splice(..0, lamps));
        let rotation_deg = self.options.rotation_deg;
        if let Some(map) = &self.options.environment {
            scene.inputs.push(map.clone());
            let rotation_deg = rotation_deg.unwrap_or(0.0);
            self.check_range("environment.rotation_deg", &[rotation_deg], FINITE)?;
            let map = EnvironmentMap::load(map, 1.0, &mut scene.warnings)?;
            scene.environment = map.turned(rotation_deg);
        } else if let Some(entry) = &file.environment {
            let mut entry = entry.clone();
            let is_file = |map: &&PathBuf| !self.arrays.images.contains_key(*map);
            let files = entry.map.iter().filter(is_file);
            scene.inputs.extend(files.map(|map| self.file(map)));
            entry.rotation_deg = rotation_deg.unwrap_or(entry.rotation_deg);
            scene.environment = self.environment(&entry, &mut scene.warnings)?;
        }
        scene.portals = self.portals(&file.portals)?;
        Ok(())
    }

    fn environment(
        &self,
        entry: &EnvironmentEntry,
        warnings: &mut Vec<String>,
    ) -> Result<EnvironmentMap> {
        let (scale, rotation_deg) = (entry.scale, entry.rotation_deg);
        self.check_range("environment.scale", &[scale], (0.0, f32::MAX))?;
        self.check_range("environment.rotation_deg", &[rotation_deg], FINITE)?;
        let sources = [
            ("map", entry.map.is_some()),
            ("constant", entry.constant.is_some()),
            ("court", entry.court.is_some()),
            ("sky", entry.sky.is_some()),
            ("daylight", entry.daylight.is_some()),
        ];
        let found: Vec<_> =
            sources.iter().filter(|source| source.1).map(|(name, _)| *name).collect();
        let [name] = found[..] else {
            let found = if found.is_empty() { "none".to_owned() } else { found.join(" and ") };
            return Err(self.error(format!(
                "environment: expected exactly one of map, constant, court, sky, daylight, found \
                 {found}"
            )));
        };
        let error = |message: String| self.error(format!("environment.{name}: {message}"));
        let made = if let Some(map) = &entry.map {
            let Some(image) = self.arrays.images.get(map) else {
                let map = EnvironmentMap::load(&self.file(map), scale, warnings)?;
                return Ok(map.turned(rotation_deg));
            };
            EnvironmentMap::of_image(&map.display().to_string(), image, scale, warnings)
        } else if let Some(court) = &entry.court {
            EnvironmentMap::court(court, scale)
        } else if let Some(sky) = &entry.sky {
            EnvironmentMap::sky(sky, scale)
        } else if let Some(daylight) = &entry.daylight {
            EnvironmentMap::daylight(daylight, scale)
        } else {
            let constant = entry.constant.unwrap_or_default();
            let constant = self.vector("environment.constant", constant, (0.0, f32::MAX))?;
            return EnvironmentMap::constant(constant, scale).map_err(error);
        };
        made.map(|map| map.turned(rotation_deg)).map_err(error)
    }

    fn lamp(&self, index: usize, entry: &LampEntry) -> Result<Lamp> {
        let keys = &entry.keys;
        let label = label("lamp", index, keys.name.as_deref());
        let label = format!("{label} (line {})", entry.line);
        let place = |position| self.vector(&format!("{label}: position"), position, FINITE);
        let power =
            |key: &str, power| self.vector(&format!("{label}: {key}"), power, (0.0, f32::MAX));
        let direction = |direction: [f32; 3]| {
            let unit = Vec3::from_array(direction).try_normalize();
            unit.ok_or_else(|| {
                self.error(format!(
                    "{label}: direction: expected a vector other than 0, found {direction:?}"
                ))
            })
        };
        let kind = match &entry.kind {
            LampKindEntry::Point(entry) => LampKind::Point {
                position: place(entry.position)?,
                intensity: power("intensity", entry.intensity)?,
            },
            LampKindEntry::Spot(entry) => {
                let (inner, outer) = (entry.inner_angle_deg, entry.outer_angle_deg);
                let range = (0.0, 180.0);
                self.check_range(&format!("{label}: inner_angle_deg"), &[inner], range)?;
                self.check_range(&format!("{label}: outer_angle_deg"), &[outer], range)?;
                self.check(inner < outer, || {
                    format!(
                        "{label}: expected inner_angle_deg below outer_angle_deg, found {inner} and \
                         {outer}"
                    )
                })?;
                LampKind::Spot(Spot {
                    position: place(entry.position)?,
                    direction: direction(entry.direction)?,
                    intensity: power("intensity", entry.intensity)?,
                    inner_angle_rad: inner.to_radians(),
                    outer_angle_rad: outer.to_radians(),
                    falloff: entry.falloff,
                })
            }
            LampKindEntry::Directional(entry) => LampKind::Directional {
                direction: direction(entry.direction)?,
                irradiance: power("irradiance", entry.irradiance)?,
            },
        };
        self.check_light_group(&label, keys.light_group.as_deref())?;
        let name = keys.name.clone().unwrap_or_default();
        Ok(Lamp { name, kind, light_group: keys.light_group.clone() })
    }

    /// Checks that a group can name a layer of an image.
    pub(super) fn check_light_group(&self, label: &str, name: Option<&str>) -> Result<()> {
        let is_known = |letter: char| letter.is_alphanumeric() || " _-".contains(letter);
        let fits = |name: &str| !name.is_empty() && name.len() < 64 && name.chars().all(is_known);
        self.check(name.is_none_or(fits), || {
            format!(
                "{label}: light_group: expected up to 63 letters, digits, spaces, `_` and `-`, found \
                 `{}`",
                name.unwrap_or_default()
            )
        })
    }

    pub(super) fn portals(&self, entries: &[Entry<PortalKeys>]) -> Result<Vec<Portal>> {
        self.check(entries.len() <= MAX_PORTALS, || {
            format!(
                "expected at most {MAX_PORTALS} `[[portal]]`, found {}: join those of one wall",
                entries.len()
            )
        })?;
        entries.iter().enumerate().map(|(index, entry)| self.portal(index, entry)).collect()
    }

    fn portal(&self, index: usize, entry: &Entry<PortalKeys>) -> Result<Portal> {
        let keys = &entry.keys;
        let label = label("portal", index, keys.name.as_deref());
        let label = format!("{label} (line {})", entry.line);
        let corner = self.vector(&format!("{label}: corner"), keys.corner, (-1e6, 1e6))?;
        let edge = |key: &str, edge: [f32; 3]| {
            let edge = self.vector(&format!("{label}: {key}"), edge, FINITE)?;
            let (low, high) = EDGES;
            self.check((low..=high).contains(&edge.length()), || {
                format!(
                    "{label}: {key}: expected an edge of {low} to {high} m, found {edge}, {} m long",
                    edge.length()
                )
            })?;
            Ok((edge.normalize(), edge.length()))
        };
        let (first, width) = edge("first_edge", keys.first_edge)?;
        let (second, height) = edge("second_edge", keys.second_edge)?;
        let cosine = first.dot(second);
        self.check(cosine.abs() <= RIGHT_ANGLE, || {
            format!(
                "{label}: expected first_edge and second_edge at right angles, found {:.2} degrees: a \
                 portal is a rectangle",
                cosine.acos().to_degrees()
            )
        })?;
        let second = (second - cosine * first).normalize();
        Ok(Portal {
            name: keys.name.clone().unwrap_or_default(),
            corner,
            axes: [first, second],
            size: [width, height],
        })
    }
}

/// Lengths of edges, metres: products of three of them stay far inside single precision.
const EDGES: (f32, f32) = (1e-6, 1e6);

/// Largest cosine between edges that counts as a right angle: a twentieth of a degree.
const RIGHT_ANGLE: f32 = 1e-3;
