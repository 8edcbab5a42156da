//! Panel and help over the window: drawn and asked in the window's thread, without a renderer.

use std::{sync::Arc, time::Instant};

use egui::{
    Align2, ComboBox, Context, Event, FontData, FontDefinitions, Grid, Label, PointerButton, Pos2,
    RawInput, Rect, ScrollArea, SidePanel, Slider, SliderClamping, Ui, pos2, vec2,
};

use super::{
    keys::{Action, rows},
    message::{Denoise, Input, Setting, Status},
    overlay::Canvas,
    projector::Overlay,
};
use crate::{film::Curve, sampler::Sampler};

pub(super) const WIDTH: u32 = 250;
/// Least size of a window with a panel, pixels.
const LEAST_WINDOW: [u32; 2] = [WIDTH + 160, 200];
/// Turns after a change that a layout may take to settle.
const TURNS: usize = 3;

pub(super) struct Controls {
    context: Context,
    canvas: Canvas,
    events: Vec<Event>,
    start: Instant,
    pointer: Pos2,
    /// State that the panel shows, and the newest one.
    status: Option<Status>,
    latest: Option<Status>,
    is_open: bool,
    shows_help: bool,
    drawn: Overlay,
}

impl Controls {
    pub(super) fn new() -> Self {
        let context = Context::default();
        let mut fonts = FontDefinitions::empty();
        let noto = FontData::from_static(ttf_noto_sans::REGULAR);
        fonts.font_data.insert("Noto Sans".into(), Arc::new(noto));
        fonts.families.values_mut().for_each(|names| names.push("Noto Sans".into()));
        context.set_fonts(fonts);
        context.all_styles_mut(|style| {
            style.animation_time = 0.0;
            style.spacing.slider_width = 120.0;
            style.spacing.item_spacing.y = 2.0;
            style.interaction.selectable_labels = false;
            style.visuals = egui::Visuals::dark();
            style.text_styles.values_mut().for_each(|font| font.size = 12.0);
        });
        Self {
            context,
            canvas: Canvas::default(),
            events: Vec::new(),
            start: Instant::now(),
            pointer: Pos2::ZERO,
            status: None,
            latest: None,
            is_open: true,
            shows_help: false,
            drawn: Overlay::default(),
        }
    }

    /// True if a window of this size, pixels, has room for the panel.
    pub(super) fn fit([width, height]: [u32; 2]) -> bool {
        width >= LEAST_WINDOW[0] && height >= LEAST_WINDOW[1]
    }

    pub(super) fn report(&mut self, status: Status) {
        self.latest = Some(status);
    }

    /// Acts on a key that concerns the controls alone. Returns false for any other.
    pub(super) fn act(&mut self, action: Action) -> bool {
        match action {
            Action::Panel => self.is_open = !self.is_open,
            Action::Help => self.shows_help = !self.shows_help,
            Action::Quit if self.shows_help => self.shows_help = false,
            _ => return false,
        }
        true
    }

    /// True if a number is being typed.
    pub(super) fn wants_keys(&self) -> bool {
        self.context.wants_keyboard_input()
    }

    /// True if the pointer is over a control, or drags one.
    pub(super) fn wants_pointer(&self) -> bool {
        self.context.is_using_pointer() || self.context.is_pointer_over_area()
    }

    pub(super) fn point(&mut self, [x, y]: [f64; 2]) {
        self.pointer = pos2(x as f32, y as f32);
        self.events.push(Event::PointerMoved(self.pointer));
    }

    /// Presses or releases the first button of the pointer.
    pub(super) fn click(&mut self, pressed: bool) {
        let (pos, button, modifiers) = (self.pointer, PointerButton::Primary, Default::default());
        self.events.push(Event::PointerButton { pos, button, pressed, modifiers });
    }

    pub(super) fn scroll(&mut self, pixels: f32) {
        let (unit, delta) = (egui::MouseWheelUnit::Point, vec2(0.0, pixels));
        self.events.push(Event::MouseWheel { unit, delta, modifiers: Default::default() });
    }

    /// Types a text, or presses the key of this name.
    pub(super) fn type_in(&mut self, text: &str, pressed: bool) {
        match egui::Key::from_name(text).filter(|_| text.chars().count() > 1) {
            Some(key) => self.events.push(Event::Key {
                key,
                physical_key: None,
                pressed,
                repeat: false,
                modifiers: Default::default(),
            }),
            None if pressed => self.events.push(Event::Text(text.to_owned())),
            None => {}
        }
    }

    /// Lays out and draws the controls for a window of `size` pixels. Returns what the user has set, and
    /// the new looks if they have changed.
    pub(super) fn refresh(&mut self, size: [u32; 2]) -> Vec<Input> {
        let mut inputs = Vec::new();
        // A control that is held keeps the value that it is given.
        if !self.context.is_using_pointer() {
            self.status = self.latest.take().or(self.status.take());
        }
        let has_panel = self.is_open && Self::fit(size) && self.status.is_some();
        let (mut status, shows_help) = (self.status.take(), self.shows_help);
        let mut primitives = Vec::new();
        for _ in 0..TURNS {
            let screen = Rect::from_min_max(Pos2::ZERO, pos2(size[0] as f32, size[1] as f32));
            let input = RawInput {
                screen_rect: Some(screen),
                time: Some(self.start.elapsed().as_secs_f64()),
                events: std::mem::take(&mut self.events),
                ..RawInput::default()
            };
            let output = self.context.run(input, |context| {
                if let Some(status) = status.as_mut().filter(|_| has_panel) {
                    let panel = SidePanel::left("panel").exact_width(WIDTH as f32);
                    panel.resizable(false).show(context, |ui| {
                        ScrollArea::vertical().show(ui, |ui| panel_of(ui, status, &mut inputs));
                    });
                }
                if shows_help {
                    help(context);
                }
            });
            self.canvas.update(&output.textures_delta);
            primitives = self.context.tessellate(output.shapes, output.pixels_per_point);
            let mut viewports = output.viewport_output.values();
            if viewports.all(|viewport| !viewport.repaint_delay.is_zero()) {
                break;
            }
        }
        self.status = status;
        let picture = self.canvas.draw(&primitives, size);
        let drawn = Overlay { picture, reserved: if has_panel { WIDTH } else { 0 } };
        if drawn != self.drawn {
            inputs.push(Input::Overlay(drawn.clone()));
            self.drawn = drawn;
        }
        inputs
    }
}

fn panel_of(ui: &mut Ui, status: &mut Status, inputs: &mut Vec<Input>) {
    let mut set = |setting| inputs.push(Input::Set(setting));
    let mut keys = Vec::new();
    ui.add_space(4.0);
    ui.horizontal(|ui| {
        let box_of = ComboBox::from_id_salt("sampler").selected_text(status.sampler.name());
        box_of.height(400.0).show_ui(ui, |ui| {
            for sampler in Sampler::ALL {
                if ui.selectable_label(*sampler == status.sampler, sampler.name()).clicked() {
                    keys.push(Action::Sampler(*sampler));
                }
            }
        });
        ui.label(format!("depth {}", status.depth));
        for (sign, more) in [("-", -1), ("+", 1)] {
            if ui.small_button(sign).clicked() {
                keys.push(Action::Depth(more));
            }
        }
    });
    ui.horizontal(|ui| {
        if ui.selectable_label(status.is_split, "side by side").clicked() {
            keys.push(Action::Split);
        }
        if status.is_split && ui.button("other side").clicked() {
            keys.push(Action::Swap);
        }
    });
    ui.separator();
    ui.horizontal(|ui| {
        let exposure = Slider::new(&mut status.tone.exposure, -8.0..=8.0).step_by(0.1).text("EV");
        if ui.add(exposure.clamping(SliderClamping::Edits)).changed() {
            set(Setting::Exposure(status.tone.exposure));
        }
        if ui.small_button("auto").clicked() {
            keys.push(Action::AutoExposure);
        }
    });
    ui.horizontal(|ui| {
        for curve in Curve::ALL {
            let name = format!("{curve:?}").to_lowercase();
            if ui.selectable_value(&mut status.tone.curve, curve, name).clicked() {
                set(Setting::Curve(curve));
            }
        }
    });
    ui.horizontal(|ui| {
        ui.label("denoise");
        for (denoise, name) in Denoise::ALL {
            if ui.selectable_value(&mut status.denoise, denoise, name).clicked() {
                set(Setting::Denoise(denoise));
            }
        }
    });
    ui.separator();
    let camera = &mut status.camera;
    let mut slide = |value: &mut f32, low: f32, high: f32, text: &str, of: fn(f32) -> Setting| {
        let slider = Slider::new(value, low..=high).text(text);
        let slider = if low * 20.0 < high {
            slider.logarithmic(true).smallest_positive(0.1)
        } else {
            slider
        };
        if ui.add(slider.max_decimals(3).clamping(SliderClamping::Edits)).changed() {
            set(of(*value));
        }
    };
    slide(&mut status.speed, 0.1, 10.0, "speed", Setting::Speed);
    slide(&mut camera.vertical_fov_deg, 10.0, 120.0, "view °", Setting::FieldOfView);
    let mut radius_mm = 1e3 * camera.aperture_radius;
    slide(&mut radius_mm, 0.0, 200.0, "lens mm", |mm| Setting::Aperture(1e-3 * mm));
    camera.aperture_radius = 1e-3 * radius_mm;
    slide(&mut camera.focus_distance, 0.01, 1000.0, "focus m", Setting::Focus);
    ui.separator();
    ui.horizontal_wrapped(|ui| {
        for (text, action) in
            [("bookmark", Action::Bookmark), ("save", Action::Save), ("home", Action::Home)]
        {
            if ui.button(text).clicked() {
                keys.push(action);
            }
        }
        for (number, name) in status.views.iter().enumerate() {
            if ui.button(name).clicked() {
                set(Setting::View(number));
            }
        }
    });
    ui.separator();
    let [samples, most] = status.samples;
    ui.label(format!("{samples} of {most} samples in {:.1} s", status.seconds));
    let percent = |error: f64| format!("relative error {:.1}%", 100.0 * error);
    ui.label(status.error.map_or_else(|| "relative error unknown".into(), percent));
    Grid::new("passes").spacing(vec2(12.0, 0.0)).show(ui, |ui| {
        for (name, ms) in &status.pass_ms {
            ui.label(format!("{ms:.2} ms"));
            ui.label(name);
            ui.end_row();
        }
    });
    if ui.button("keys (?)").clicked() {
        keys.push(Action::Help);
    }
    ui.add(Label::new(&status.notice).wrap());
    inputs.extend(keys.into_iter().map(Input::Key));
}

fn help(context: &Context) {
    let window = egui::Window::new("Keys").anchor(Align2::CENTER_CENTER, [0.0, 0.0]);
    window.collapsible(false).resizable(false).vscroll(true).show(context, |ui| {
        Grid::new("keys").max_col_width(360.0).show(ui, |ui| {
            for (keys, about) in rows() {
                ui.add(Label::new(keys).wrap());
                ui.add(Label::new(about).wrap());
                ui.end_row();
            }
        });
    });
}
