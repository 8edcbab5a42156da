//! The window: events of the display → input of the rendering thread.

use std::{
    collections::BTreeSet,
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Receiver, Sender, channel},
    },
    thread::{self, JoinHandle},
};

use winit::{
    application::ApplicationHandler,
    dpi::PhysicalSize,
    event::{ElementState, MouseButton, MouseScrollDelta, StartCause, WindowEvent},
    event_loop::{ActiveEventLoop, EventLoop, EventLoopProxy},
    keyboard::{Key, NamedKey},
    raw_window_handle::HasDisplayHandle,
    window::{Window, WindowId},
};

use super::{
    inset,
    keys::{Action, action_of},
    panel::{Input, Panel},
    projector::Projector,
    side::Side,
    worker::{Parts, Worker},
};
use crate::{
    error::{Error, Result},
    film::Tone,
    gpu::{Capabilities, Device, Tracer},
    scene::Scene,
    session::Settings,
};

/// Pixels of the wheel's finer events in a notch.
const PIXELS_PER_NOTCH: f64 = 40.0;
/// Advice without a display.
const NO_DISPLAY_HELP: &str =
    "a window needs DISPLAY to name a running X server; `fenestra render` needs none";

/// Options of [`Display::run`].
#[derive(Clone, Debug)]
pub struct Options {
    /// Device by index or name, as in [`Device::open`].
    pub device: Option<String>,
    /// Choice of what traces.
    pub tracer: Tracer,
    /// True to run with the validation layers.
    pub validate: bool,
    /// Refuses a device that must not be used.
    pub check: fn(&Capabilities) -> Result<()>,
    /// Settings of the renderer.
    pub settings: Settings,
    /// Samples per pixel at which a film is finished.
    pub spp: u32,
    /// Exposure and curve at the start.
    pub tone: Tone,
    /// Folder of the files that a key writes.
    pub folder: PathBuf,
}

/// Message from the rendering thread.
enum Report {
    Title(String),
    Ended,
}

/// A display that shows windows.
pub(crate) struct Display(EventLoop<Report>);

impl Display {
    /// Connects to the display of the environment. Once in a process, in its first thread.
    ///
    /// # Errors
    /// [`Error::Device`] if there is none.
    pub(crate) fn open() -> Result<Self> {
        let event_loop = EventLoop::with_user_event().build();
        event_loop.map(Self).map_err(|error| no_window(&error))
    }

    /// Shows `scene` until its window is closed.
    ///
    /// # Errors
    /// [`Error::Device`] without a device that can show pictures there; all that rendering can fail of.
    pub(crate) fn run(self, scene: Scene, options: Options) -> Result<()> {
        let Self(event_loop) = self;
        let (sender, inputs) = channel();
        let mut app = App {
            start: Some((scene, options, inputs)),
            proxy: event_loop.create_proxy(),
            sender,
            window: None,
            rendering: None,
            failure: None,
            pointer: None,
            buttons: BTreeSet::new(),
            held: Vec::new(),
        };
        let ran = event_loop.run_app(&mut app);
        let App { failure, rendering, sender, .. } = app;
        // Whatever ended the loop, the rendering thread ends too.
        drop(sender);
        let rendered = rendering.map_or(Ok(()), |thread| {
            thread.join().unwrap_or_else(|_| Err(Error::usage("the rendering thread has failed")))
        });
        failure.map_or(Ok(()), Err).and(rendered)?;
        ran.map_err(|error| no_window(&error))
    }
}

/// Returns the error for a display that shows no window.
fn no_window(error: &dyn std::fmt::Display) -> Error {
    Error::Device {
        reason: format!("no window can be opened: {error}"),
        help: NO_DISPLAY_HELP.into(),
    }
}

/// The window's thread.
struct App {
    /// Start of the rendering thread.
    start: Option<(Scene, Options, Receiver<Input>)>,
    proxy: EventLoopProxy<Report>,
    sender: Sender<Input>,
    window: Option<Arc<Window>>,
    rendering: Option<JoinHandle<Result<()>>>,
    failure: Option<Error>,
    pointer: Option<[f64; 2]>,
    buttons: BTreeSet<Drag>,
    /// Axes and senses of the flying keys that are held, each with its key.
    held: Vec<(String, usize, f32)>,
}

/// Effect of the pointer while a button is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Drag {
    Orbit,
    Turn,
    Pan,
}

impl App {
    fn send(&self, input: Input) {
        // A thread that has ended reports so.
        let _ = self.sender.send(input);
    }

    fn open(&mut self, event_loop: &ActiveEventLoop) -> Result<()> {
        let Some((scene, options, inputs)) = self.start.take() else { return Ok(()) };
        let size = PhysicalSize::new(scene.film.width, scene.film.height);
        let attributes = Window::default_attributes()
            .with_title(format!("{} | preparing {}", scene.name, options.settings.sampler.name()))
            .with_inner_size(size);
        let window = event_loop.create_window(attributes).map_err(|error| no_window(&error))?;
        let window = Arc::new(window);
        self.window = Some(Arc::clone(&window));
        let proxy = self.proxy.clone();
        let render = move || {
            let result = render(scene, options, inputs, window, proxy.clone());
            let _ = proxy.send_event(Report::Ended);
            result
        };
        let thread = thread::Builder::new().name("rendering".into()).spawn(render);
        self.rendering = Some(thread.map_err(|error| {
            Error::usage(format!("the system allows no thread to render in: {error}"))
        })?);
        Ok(())
    }

    fn press(&mut self, key: &Key, state: ElementState, is_repeat: bool) {
        let name = match key {
            Key::Character(text) => text.to_lowercase(),
            Key::Named(NamedKey::Escape) => "Escape".to_owned(),
            Key::Named(NamedKey::Tab) => "Tab".to_owned(),
            _ => return,
        };
        match (action_of(&name), state) {
            (Some(Action::Fly(axis, sense)), ElementState::Pressed) if !is_repeat => {
                self.held.push((name, axis, sense));
                self.send_held();
            }
            (Some(Action::Fly(..)), ElementState::Released) => {
                self.held.retain(|(held, ..)| *held != name);
                self.send_held();
            }
            (Some(Action::Fly(..)), ElementState::Pressed) => {}
            (Some(action), ElementState::Pressed) => self.send(Input::Key(action)),
            _ => {}
        }
    }

    fn send_held(&self) {
        let mut direction = [0.0_f32; 3];
        for (_, axis, sense) in &self.held {
            direction[*axis] += sense;
        }
        self.send(Input::Held(direction));
    }

    fn move_pointer(&mut self, to: [f64; 2]) {
        let from = self.pointer.replace(to).unwrap_or(to);
        let height = self.window.as_ref().map_or(1, |window| window.inner_size().height.max(1));
        let way = [0, 1].map(|axis| ((to[axis] - from[axis]) / f64::from(height)) as f32);
        let input = match self.buttons.first() {
            None => Input::Pointer(to),
            Some(_) if way == [0.0; 2] => return,
            Some(Drag::Orbit) => Input::Orbit(way),
            Some(Drag::Turn) => Input::Turn(way),
            Some(Drag::Pan) => Input::Pan(way),
        };
        self.send(input);
    }
}

impl ApplicationHandler<Report> for App {
    fn new_events(&mut self, _event_loop: &ActiveEventLoop, _cause: StartCause) {}

    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if let Err(error) = self.open(event_loop) {
            self.failure = Some(error);
            event_loop.exit();
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, report: Report) {
        match report {
            Report::Title(title) => {
                if let Some(window) = &self.window {
                    window.set_title(&title);
                }
            }
            Report::Ended => event_loop.exit(),
        }
    }

    fn window_event(&mut self, _event_loop: &ActiveEventLoop, _id: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => self.send(Input::Close),
            WindowEvent::Resized(size) => self.send(Input::Resized([size.width, size.height])),
            WindowEvent::RedrawRequested => self.send(Input::Redraw),
            WindowEvent::Focused(false) => {
                self.held.clear();
                self.buttons.clear();
                self.send_held();
            }
            WindowEvent::KeyboardInput { event, .. } => {
                self.press(&event.logical_key, event.state, event.repeat);
            }
            WindowEvent::CursorMoved { position, .. } => {
                self.move_pointer([position.x, position.y])
            }
            WindowEvent::MouseInput { state, button, .. } => {
                let drag = match button {
                    MouseButton::Left => Drag::Orbit,
                    MouseButton::Right => Drag::Turn,
                    MouseButton::Middle => Drag::Pan,
                    _ => return,
                };
                match state {
                    ElementState::Pressed => self.buttons.insert(drag),
                    ElementState::Released => self.buttons.remove(&drag),
                };
            }
            WindowEvent::MouseWheel { delta, .. } => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => lines,
                    MouseScrollDelta::PixelDelta(way) => (way.y / PIXELS_PER_NOTCH) as f32,
                };
                if notches != 0.0 {
                    self.send(Input::Wheel(notches));
                }
            }
            _ => {}
        }
    }
}

/// The rendering thread, from the opening of the device to the end.
fn render(
    scene: Scene,
    options: Options,
    inputs: Receiver<Input>,
    window: Arc<Window>,
    proxy: EventLoopProxy<Report>,
) -> Result<()> {
    let Options { device: wanted, tracer, validate, check, settings, spp, tone, folder } = options;
    let display = window.display_handle().map_err(|error| no_window(&error))?.as_raw();
    let device = Device::open_for_display(wanted.as_deref(), validate, tracer, display, check)?;
    let projector = Projector::new(&device, [scene.film.width, scene.film.height], inset::SIZE)?;
    let left = Side::new(&device, &scene, None, &settings, None)?;
    let size = window.inner_size();
    let panel = Panel::new(&device, window, [size.width, size.height], projector, inputs, tone)?;
    let announce = Box::new(move |title| {
        let _ = proxy.send_event(Report::Title(title));
    });
    let parts =
        Parts { scene, device: Arc::clone(&device), settings, spp, left, panel, folder, announce };
    let mut worker = Worker::new(parts);
    let result = worker.run();
    device.save_pipeline_cache();
    drop(worker);
    result.and_then(|()| device.check_validation())
}
