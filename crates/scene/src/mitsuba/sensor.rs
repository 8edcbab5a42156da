//! Sensors and their film → [`CameraEntry`] and [`FilmSettings`].

use glam::{DVec2, DVec3};

use super::{
    Reader,
    document::Node,
    parameters::{NO_INVERSE, Parameters, turned},
};
use crate::{
    Asked, FilmSettings, Filter, MAX_FILM_SIDE, error::Result, features, file::CameraEntry,
    import::FAR,
};

/// Diagonal of a film of 36 × 24 mm, millimetres.
const FILM_DIAGONAL_MM: f64 = 43.266_615_305_567_87;
/// Vertical fields of view that a camera may have, degrees.
const FOV_RANGE_DEG: (f64, f64) = (0.01, 179.0);

/// Film with the part of it that is rendered.
struct Film {
    settings: FilmSettings,
    /// Width and height of the whole film, pixels.
    whole: DVec2,
    /// Place of the part's middle from that of the whole, pixels.
    middle: DVec2,
}

impl Reader {
    /// Reads the sensor named or numbered `name`, else the first, and names the others; `root` is the place
    /// of errors.
    pub(super) fn sensor(
        &mut self,
        root: Node<'_>,
        sensors: &[Node<'_>],
        name: Option<&str>,
    ) -> Result<(Option<CameraEntry>, FilmSettings)> {
        let worth = |sensor: Node<'_>| match sensor.kind() {
            "perspective" | "thinlens" => 2,
            kind => usize::from(kind == "orthographic"),
        };
        let chosen = match name {
            None => {
                (0..sensors.len()).rev().max_by_key(|index| worth(sensors[*index])).unwrap_or(0)
            }
            Some(name) => {
                let has_id = |sensor: &Node<'_>| sensor.attribute("id") == Some(name);
                let by_number = || name.parse().ok().filter(|&index: &usize| index < sensors.len());
                let Some(chosen) = sensors.iter().position(has_id).or_else(by_number) else {
                    let ids = sensors.iter().enumerate().map(|(index, sensor)| {
                        sensor.attribute("id").map_or(index.to_string(), |id| format!("`{id}`"))
                    });
                    let known = ids.collect::<Vec<_>>().join(", ");
                    return Err(root.error(format!(
                        "--camera {name}: there is no such sensor, the file has {known}"
                    )));
                };
                chosen
            }
        };
        let Some(&sensor) = sensors.get(chosen) else {
            return Ok((None, self.film(&Parameters::new(root))?.settings));
        };
        for other in sensors.iter().filter(|other| other.index != sensor.index) {
            self.ignored.add(features::MI_SENSORS, || other.place());
        }
        let parameters = Parameters::new(sensor);
        let film = self.film(&parameters)?;
        if worth(sensor) < 2 {
            let name = format!("sensor `{}`", sensor.kind());
            self.ignored.add_named(features::MI_SENSOR, &name, || sensor.place());
        }
        if worth(sensor) == 0 {
            return Ok((None, film.settings));
        }
        let camera = self.camera(&parameters, &film)?;
        for sampler in parameters.objects("sampler")? {
            self.sampler(sampler)?;
        }
        parameters.without_effect("near_clip far_clip shutter_open shutter_close");
        parameters.finish(&mut self.ignored);
        Ok((Some(camera), film.settings))
    }

    /// Takes the samples that a file asks for.
    pub(super) fn sampler(&mut self, node: Node<'_>) -> Result<()> {
        let count = Parameters::new(node).integer("sample_count")?;
        let count = count.and_then(|count| u32::try_from(count).ok()).filter(|count| *count > 0);
        self.asked.samples = count.or(self.asked.samples);
        Ok(())
    }

    /// Takes the length of paths that a file asks for; names an integrator that makes other pictures.
    pub(super) fn integrator(&mut self, node: Node<'_>) -> Result<()> {
        let parameters = Parameters::new(node);
        for inner in parameters.objects("integrator")? {
            self.integrator(inner)?;
        }
        if parameters.boolean("hide_emitters")? == Some(true) {
            self.ignored.add(features::MI_HIDE_EMITTERS, || node.place());
        }
        let edges = match node.kind() {
            "direct" => Some(2),
            // All find light along paths, however they do.
            "path" | "volpath" | "volpathmis" | "volpath_simple" | "bdpt" | "ptracer"
            | "pssmlt" | "mlt" | "erpt" | "photonmapper" | "ppm" | "sppm" | "prb"
            | "prbvolpath" | "prb_basic" | "path_guided" => {
                Some(parameters.integer("max_depth")?.unwrap_or(-1))
            }
            // The integrator in them has been read.
            "aov" | "moment" | "adaptive" | "irrcache" | "stokes" => None,
            kind => {
                let name = format!("integrator `{kind}`");
                self.ignored.add_named(features::MI_INTEGRATOR, &name, || node.place());
                parameters.integer("max_depth")?
            }
        };
        // Mitsuba counts the edges of a path, the one to the light included.
        let most = i64::from(Asked::MAX_DEPTH) + 1;
        let cut = match edges {
            Some(..2) if edges != Some(-1) => {
                Some("`max_depth` below 2, for which direct light is rendered".to_owned())
            }
            Some(edges) if edges > most => Some(format!("`max_depth` above {most}")),
            _ => None,
        };
        if let Some(name) = cut {
            self.ignored.add_named(features::MI_INTEGRATOR, &name, || node.place());
        }
        self.asked.depth = match edges {
            None => self.asked.depth,
            Some(-1) => Some(Asked::MAX_DEPTH),
            Some(edges) => Some(edges.clamp(2, most) as u32 - 1),
        };
        let roulette = parameters.integer("rr_depth")?;
        let roulette = roulette.and_then(|depth| u32::try_from(depth).ok());
        self.asked.roulette_depth = roulette.or(self.asked.roulette_depth);
        Ok(())
    }

    fn camera(&mut self, parameters: &Parameters<'_>, film: &Film) -> Result<CameraEntry> {
        let node = parameters.node;
        let matrix = parameters.transform("to_world")?;
        let [forward, up] = [turned(node, matrix, DVec3::Z)?, turned(node, matrix, DVec3::Y)?];
        if forward.cross(up).length() < 1e-4 || matrix.determinant() == 0.0 {
            return Err(node.error(NO_INVERSE));
        }
        let offset = |name: &str| Ok(f64::from(parameters.float(name)?.unwrap_or(0.0)));
        let offset =
            DVec2::new(offset("principal_point_offset_x")?, offset("principal_point_offset_y")?);
        // The y axis of films points down.
        let height = f64::from(film.settings.height);
        let shift = (film.middle + offset * film.whole) / height * DVec2::new(1.0, -1.0);
        let aspect = film.whole.x / film.whole.y;
        let (tangent, back) = match node.kind() {
            "orthographic" => (0.5 / FAR, 2.0 * FAR * matrix.y_axis.length() / aspect),
            _ => (half_height_tangent(parameters, aspect)?, 0.0),
        };
        let tangent = tangent * height / film.whole.y;
        let vertical_fov_deg = 2.0 * tangent.atan().to_degrees();
        if !(FOV_RANGE_DEG.0..=FOV_RANGE_DEG.1).contains(&vertical_fov_deg) {
            let (low, high) = FOV_RANGE_DEG;
            return Err(node.error(format!(
                "expected a vertical field of view of {low}° to {high}°, found {vertical_fov_deg}°"
            )));
        }
        let (mut aperture_radius, mut focus_distance) = (0.0, 1.0);
        if node.kind() == "thinlens" {
            let radius = parameters.float_in("aperture_radius", (0.0, f32::MAX))?;
            aperture_radius = parameters.required("aperture_radius", radius)?;
            let far = parameters.float("far_clip")?.unwrap_or(1e4);
            let range = (f32::MIN_POSITIVE, f32::MAX);
            focus_distance = parameters.float_in("focus_distance", range)?.unwrap_or(far);
        } else {
            // A pinhole has no use for it; files that were made for both kinds have it.
            parameters.without_effect("focus_distance aperture_radius");
        }
        let position = matrix.w_axis.truncate() - back * forward;
        // Look at a point so far away that single precision keeps the direction.
        let look_at = position + forward * position.length().max(1.0);
        Ok(CameraEntry {
            position: position.as_vec3().to_array(),
            look_at: look_at.as_vec3().to_array(),
            up: up.as_vec3().to_array(),
            vertical_fov_deg: vertical_fov_deg as f32,
            aperture_radius,
            focus_distance: Some(focus_distance),
            shift: shift.as_vec2().to_array(),
            // The axes of the camera are +X to the left, +Y up, +Z along the view.
            mirrored: matrix.determinant() < 0.0,
        })
    }

    fn film(&mut self, sensor: &Parameters<'_>) -> Result<Film> {
        let node = sensor.object("film")?;
        let parameters = node.map(Parameters::new);
        let side = |name: &str, default: i64| match &parameters {
            Some(parameters) => Ok(parameters.integer(name)?.unwrap_or(default)),
            None => Ok(default),
        };
        let (width, height) = (side("width", 768)?, side("height", 576)?);
        let size = (side("crop_width", width)?, side("crop_height", height)?);
        let offset = (side("crop_offset_x", 0)?, side("crop_offset_y", 0)?);
        for (name, side) in [("width", width), ("height", height)] {
            if !(1..=i64::from(MAX_FILM_SIDE)).contains(&side) {
                return Err(node.unwrap_or(sensor.node).error(format!(
                    "film: {name}: expected 1 to {MAX_FILM_SIDE} pixels, found {side}"
                )));
            }
        }
        let fits = |offset: i64, size: i64, whole: i64| {
            offset >= 0 && size >= 1 && offset.checked_add(size).is_some_and(|end| end <= whole)
        };
        if !fits(offset.0, size.0, width) || !fits(offset.1, size.1, height) {
            return Err(node.unwrap_or(sensor.node).error(format!(
                "film: expected a crop within {width}×{height} pixels, found {}×{} from ({}, {})",
                size.0, size.1, offset.0, offset.1
            )));
        }
        let mut filter = Filter::Gaussian;
        if let Some(parameters) = &parameters {
            filter = self.filter(parameters)?;
            parameters.without_effect(
                "file_format pixel_format component_format banner sample_border compensate \
                 gamma exposure high_quality_edges attach_log label tonemap_method key burn",
            );
            parameters.finish(&mut self.ignored);
        }
        let [offset, size, whole] =
            [offset, size, (width, height)].map(|(x, y)| DVec2::new(x as f64, y as f64));
        let settings = FilmSettings { width: size.x as u32, height: size.y as u32, filter };
        Ok(Film { settings, whole, middle: offset + 0.5 * (size - whole) })
    }

    fn filter(&mut self, film: &Parameters<'_>) -> Result<Filter> {
        let Some(node) = film.object("rfilter")? else { return Ok(Filter::Gaussian) };
        let parameters = Parameters::new(node);
        let is_half = |name: &str| Ok((parameters.float(name)?.unwrap_or(0.5) - 0.5).abs() < 1e-6);
        let (filter, is_ours) = match node.kind() {
            "box" => (Filter::Box, is_half("radius")?),
            "gaussian" => (Filter::Gaussian, is_half("stddev")?),
            "tent" | "mitchell" | "catmullrom" | "lanczos" => {
                parameters.without_effect("radius B C b c lobes");
                (Filter::Gaussian, false)
            }
            found => {
                let expected = "expected box, gaussian, tent, mitchell, catmullrom or lanczos";
                return Err(node.error(format!("{expected}, found the rfilter `{found}`")));
            }
        };
        if !is_ours {
            let name =
                format!("rfilter `{}`, of which `gaussian` of ½ takes the place", node.kind());
            self.ignored.add_named(features::MI_FILTER, &name, || node.place());
        }
        parameters.finish(&mut self.ignored);
        Ok(if is_ours { filter } else { Filter::Gaussian })
    }
}

/// Tangent of half the angle between the lower and upper edges of the film.
fn half_height_tangent(parameters: &Parameters<'_>, aspect: f64) -> Result<f64> {
    let node = parameters.node;
    let diagonal = (1.0 + aspect * aspect).sqrt();
    let fov = parameters.float_in("fov", (1e-3, 179.99))?;
    let (length, axis) =
        (parameters.string("focal_length")?, parameters.string("fov_axis")?.unwrap_or("x"));
    let Some(fov) = fov else {
        let length = length.unwrap_or("50mm").trim();
        let millimetres: Option<f64> = length.trim_end_matches("mm").trim().parse().ok();
        let positive = millimetres.filter(|length| *length > 0.0 && length.is_finite());
        let Some(millimetres) = positive else {
            let message = format!("focal_length: expected millimetres, as 50mm, found `{length}`");
            return Err(node.error(message));
        };
        return Ok(0.5 * FILM_DIAGONAL_MM / millimetres / diagonal);
    };
    if length.is_some() {
        return Err(node.error("expected either `fov` or `focal_length`, found both"));
    }
    let tangent = f64::from(0.5 * fov).to_radians().tan();
    let along_x = match axis {
        "x" => true,
        "y" => false,
        "diagonal" => return Ok(tangent / diagonal),
        "smaller" => aspect <= 1.0,
        "larger" => aspect > 1.0,
        found => {
            let expected = "expected x, y, diagonal, smaller or larger";
            return Err(node.error(format!("fov_axis: {expected}, found `{found}`")));
        }
    };
    Ok(if along_x { tangent / aspect } else { tangent })
}
