//! Effects of input: motions of the camera, keys, files.

use std::path::PathBuf;

use super::{Motion, Worker};
use crate::{
    error::Result,
    files::write_text,
    sampler::Sampler,
    scene::Scene,
    session::Settings,
    shader::constants::SHOW_PICTURE,
    terminal::say,
    view::{
        keys::{Action, LAYERS},
        message::{Drag, Input, Setting},
        projector::Inset,
        save::{camera_toml, names, views, write},
        side::Side,
    },
};

/// Angle of an orbit or turn across the height of the window, radians.
const TURN: f32 = 3.0;
/// Factor of the distance at a notch of the wheel.
const NOTCH: f32 = 0.88;

impl Worker {
    /// Acts on input between passes. Returns true if the camera has moved.
    pub(super) fn apply(&mut self, input: Input) -> Result<bool> {
        let has_moved = matches!(input, Input::Drag(..) | Input::Wheel(_));
        match input {
            Input::Key(action) => return self.act(action),
            Input::Set(setting) => return self.set(setting),
            Input::Drag(Drag::Orbit, [x, y]) => self.rig.orbit(-TURN * x, TURN * y),
            Input::Drag(Drag::Turn, [x, y]) => self.rig.turn(TURN * x, -TURN * y),
            Input::Drag(Drag::Pan, [x, y]) => self.rig.pan(-x, y),
            Input::Wheel(notches) => self.rig.zoom(NOTCH.powf(notches)),
            Input::Held(direction) => self.held = direction.into(),
            Input::Pointer(_) => self.update_inset()?,
            Input::Focus(at) => self.clicked = Some(at),
            Input::Resized(_) | Input::Redraw | Input::Close | Input::Overlay(_) => {}
        }
        Ok(has_moved)
    }

    /// Acts on a key. Returns true if the camera has moved.
    fn act(&mut self, action: Action) -> Result<bool> {
        match action {
            Action::Sampler(number) => self.choose_sampler(number)?,
            Action::Depth(more) => {
                let depth = self.settings.depth.saturating_add_signed(more).clamp(1, 64);
                if depth != self.settings.depth {
                    self.settings.depth = depth;
                    self.keep_guide()?;
                    self.left = self.make_side(self.left.sampler)?;
                    if self.right.take().is_some() {
                        self.right = Some(self.make_side(self.right_sampler)?);
                    }
                    self.look(self.whole(), true)?;
                }
            }
            Action::Split => {
                if self.right.take().is_none() {
                    self.right = Some(self.make_side(self.right_sampler)?);
                } else {
                    self.chooses_right = false;
                }
                self.look(self.whole(), true)?;
            }
            Action::Swap => {
                self.chooses_right = self.right.is_some() && !self.chooses_right;
                self.tell();
            }
            Action::Layer(_) | Action::NextLayer => {
                let now = self.panel.borrow().layer;
                let at = LAYERS.iter().position(|(layer, ..)| *layer == now).unwrap_or(0);
                self.panel.borrow_mut().layer = match action {
                    Action::Layer(layer) if layer != now => layer,
                    Action::Layer(_) => SHOW_PICTURE,
                    _ => LAYERS[(at + 1) % LAYERS.len()].0,
                };
                self.show_again()?;
            }
            Action::Inset => {
                self.shows_inset = !self.shows_inset;
                self.update_inset()?;
            }
            Action::Save if self.motion == Motion::Rest && !self.is_stopped() => self.save()?,
            Action::Save => self.saves_at_rest = true,
            Action::Home => {
                self.rig.go_home();
                return Ok(true);
            }
            Action::Bookmark => {
                let [.., file] = names(&self.scene.name);
                let written = write_text(&file, &camera_toml(&self.rig.camera));
                self.notice_written(written, &[file]);
            }
            // These are done by panel or window, or hold as long as the key.
            Action::Exposure(_) | Action::AutoExposure | Action::Curve => {}
            Action::Fly(..) | Action::Quit | Action::Panel | Action::Help => {}
        }
        Ok(false)
    }

    /// Acts on a control. Returns true if the camera has changed.
    fn set(&mut self, setting: Setting) -> Result<bool> {
        let camera = &mut self.rig.camera;
        match setting {
            Setting::FieldOfView(degrees) => camera.vertical_fov_deg = degrees,
            Setting::Aperture(radius) => camera.aperture_radius = radius,
            Setting::Focus(distance) => {
                camera.focus_distance = distance;
                return Ok(camera.aperture_radius > 0.0);
            }
            Setting::View(number) => match self.views.get(number).map(|file| Scene::load(file)) {
                Some(Ok(view)) => *camera = view.camera,
                Some(Err(error)) => {
                    log::error!("{error}");
                    self.notice = error.to_string();
                    self.tell();
                    return Ok(false);
                }
                None => return Ok(false),
            },
            Setting::Speed(speed) => {
                self.rig.speed = speed;
                return Ok(false);
            }
            Setting::Denoise(choice) => {
                self.denoising.choice = choice;
                self.denoising.start_again();
                self.show_again()?;
                return Ok(false);
            }
            // These are done by the panel.
            Setting::Exposure(_) | Setting::Curve(_) => return Ok(false),
        }
        Ok(true)
    }

    /// Focuses on the point that was clicked, once the whole film has samples there.
    pub(super) fn focus(&mut self) -> Result<()> {
        if self.motion != Motion::Rest || self.is_stopped() || self.left.sample_count() == 0 {
            return Ok(());
        }
        let Some(at) = self.clicked.take() else { return Ok(()) };
        let film = self.left.session.renderer.film_size;
        let pixel = self.panel.borrow().projector.pixel_under(at, film);
        let Some([x, y]) = pixel else { return Ok(()) };
        let points = self.left.points()?;
        match points.get((y * film[0] + x) as usize) {
            Some(Some(point)) => {
                self.rig.focus(*point);
                let camera = &self.rig.camera;
                self.notice = format!("in focus: {:.3} m", camera.focus_distance);
                if camera.aperture_radius > 0.0 {
                    self.look(self.whole(), false)?;
                }
            }
            _ => self.notice = "there is nothing to focus on".into(),
        }
        self.tell();
        Ok(())
    }

    /// Says what was written, or why not: a full disk is no reason to lose the picture on the screen.
    fn notice_written(&mut self, written: Result<()>, files: &[PathBuf]) {
        match written {
            Ok(()) => {
                let names = files.iter().map(|file| file.display().to_string());
                self.notice = format!("wrote {}", names.collect::<Vec<_>>().join(", "));
                say!("{}", self.notice);
            }
            Err(error) => {
                log::error!("{error}");
                self.notice = error.to_string();
            }
        }
        self.views = views(&self.scene.name);
        self.tell();
    }

    /// Shows what the films have, unless a pass was stopped in them.
    fn show_again(&mut self) -> Result<()> {
        self.looked_at = None;
        if self.is_stopped() { Ok(()) } else { self.show() }
    }

    fn choose_sampler(&mut self, sampler: Sampler) -> Result<()> {
        if self.chooses_right {
            self.right_sampler = sampler;
            self.right = None;
            self.right = Some(self.make_side(sampler)?);
        } else if sampler != self.left.sampler {
            self.keep_guide()?;
            self.left = self.make_side(sampler)?;
        }
        self.look(self.whole(), true)
    }

    /// Keeps what the left side has learned for the next renderer.
    fn keep_guide(&mut self) -> Result<()> {
        self.guide = self.left.session.renderer.guide()?.or(self.guide.take());
        Ok(())
    }

    pub(super) fn make_side(&self, sampler: Sampler) -> Result<Side> {
        let title = format!("{} | preparing {}", self.scene.name, sampler.name());
        (self.announce)(self.status(title));
        let settings = Settings { sampler, ..self.settings.clone() };
        let buffers = Some(self.left.session.renderer.runner.scene.clone());
        let guide = self.guide.as_deref();
        let mut side = Side::new(&self.device, &self.scene, buffers, &settings, guide)?;
        side.session.renderer.set_watch(self.watch());
        Ok(side)
    }

    fn update_inset(&mut self) -> Result<()> {
        if self.shows_inset {
            if self.motion == Motion::Rest && !self.is_stopped() {
                self.draw_inset()?;
                self.panel.borrow_mut().present()?;
            }
        } else {
            let mut panel = self.panel.borrow_mut();
            panel.projector.set_inset(&Inset::default())?;
            if self.left.sample_count() > 0 {
                panel.present()?;
            }
        }
        Ok(())
    }

    /// Draws what the pixel under the pointer has learned, into the inset.
    pub(super) fn draw_inset(&mut self) -> Result<()> {
        let film = self.left.session.renderer.film_size;
        let panel = self.panel.borrow();
        let pixel = panel.pointer.and_then(|at| panel.projector.pixel_under(at, film));
        drop(panel);
        let recorded = match pixel {
            Some(pixel) => self.left.session.renderer.inspect_pixel(pixel)?,
            None => None,
        };
        let drawn = recorded.and_then(|recorded| Inset::of(&self.scene, recorded.as_ref()));
        self.panel.borrow_mut().projector.set_inset(&drawn.unwrap_or_default())
    }

    /// Writes the window, the film and the camera, and says where.
    pub(super) fn save(&mut self) -> Result<()> {
        if self.left.sample_count() == 0 {
            self.saves_at_rest = true;
            return Ok(());
        }
        let (width, pixels) = self.panel.borrow_mut().picture()?;
        let film = self.left.session.image(&[])?;
        let files = names(&self.scene.name);
        let written = write(&files, (width, &pixels), &film, &self.rig.camera);
        self.notice_written(written, &files);
        Ok(())
    }
}
