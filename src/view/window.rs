//! The window: events of the display → input of the rendering thread.

use std::{
    cell::RefCell,
    collections::BTreeSet,
    rc::Rc,
    sync::{
        Arc,
        mpsc::{Receiver, Sender, channel},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use winit::{
    application::ApplicationHandler,
    dpi::PhysicalSize,
    event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent},
    event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy},
    keyboard::{Key, NamedKey},
    raw_window_handle::HasDisplayHandle,
    window::{Window, WindowId},
};

use super::{
    controls::{self, Controls},
    keys::{Action, action_of},
    message::{Drag, Input, Status},
    panel::Panel,
    projector::Projector,
    side::Side,
    worker::Worker,
};
use crate::{
    error::{Error, Result},
    film::Tone,
    gpu::{Capabilities, Device, Tracer},
    sampler::Sampler,
    scene::Scene,
    session::Settings,
};

/// Pixels of the wheel's finer events in a notch.
const PIXELS_PER_NOTCH: f64 = 40.0;
/// Interval at which the controls follow the renderer.
const FOLLOWING: Duration = Duration::from_millis(250);
/// Way of the pointer, pixels, up to which a press and a release are a click.
const CLICK_WAY: f64 = 4.0;
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
}

/// Message from the rendering thread.
enum Report {
    Status(Box<Status>),
    Ended,
}

/// A display that shows windows.
pub(crate) struct Display(EventLoop<Report>);

impl Display {
    /// Connects to the display of the environment. Once in a process, in its first thread. Fails with
    /// [`Error::Device`] if there is none.
    pub(crate) fn open() -> Result<Self> {
        let event_loop = EventLoop::with_user_event().build();
        event_loop.map(Self).map_err(|error| no_window(&error))
    }

    /// Shows `scene` until its window is closed. Fails with [`Error::Device`] without a device that can show
    /// pictures there, and as all that renders.
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
            controls: Controls::new(),
            drawn_at: Instant::now(),
            size: [0; 2],
            is_due: false,
            is_stale: false,
            pressed: None,
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
    controls: Controls,
    /// Time that the controls were drawn last.
    drawn_at: Instant,
    size: [u32; 2],
    /// True if they must be drawn at once.
    is_due: bool,
    /// True if the renderer has reported since.
    is_stale: bool,
    /// Place at which the first button was pressed, while this may be a click.
    pressed: Option<[f64; 2]>,
}

impl App {
    fn send(&self, input: Input) {
        // A thread that has ended reports so.
        let _ = self.sender.send(input);
    }

    fn open(&mut self, event_loop: &ActiveEventLoop) -> Result<()> {
        let Some((scene, options, inputs)) = self.start.take() else { return Ok(()) };
        let [width, height] = [scene.film.width, scene.film.height];
        let beside = [width + controls::WIDTH, height];
        let size = if Controls::fit(beside) { beside } else { [width, height] };
        let size = PhysicalSize::new(size[0], size[1]);
        let attributes = Window::default_attributes()
            .with_title(format!("{} | preparing {}", scene.name, options.settings.sampler.name()))
            .with_inner_size(size);
        let window = event_loop.create_window(attributes).map_err(|error| no_window(&error))?;
        let window = Arc::new(window);
        // Kept, since to ask a display that is gone is a panic of winit.
        let size: [u32; 2] = window.inner_size().into();
        self.size = size;
        self.window = Some(Arc::clone(&window));
        let proxy = self.proxy.clone();
        let render = move || {
            let result = render(scene, options, inputs, (window, size), proxy.clone());
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
            Key::Named(NamedKey::Space) => " ".to_owned(),
            Key::Named(named) => format!("{named:?}"),
            _ => return,
        };
        if self.controls.wants_keys() {
            self.controls.type_in(&name, state == ElementState::Pressed);
            self.is_due = true;
            return;
        }
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
            (Some(action), ElementState::Pressed) => self.give(Input::Key(action)),
            _ => {}
        }
    }

    /// Gives input to the controls, if it is theirs, or to the renderer.
    fn give(&mut self, input: Input) {
        match input {
            Input::Key(action) if self.controls.act(action) => self.is_due = true,
            other => self.send(other),
        }
    }

    /// Draws the controls anew.
    fn refresh(&mut self) {
        if self.window.is_none() {
            return;
        }
        (self.is_due, self.is_stale, self.drawn_at) = (false, false, Instant::now());
        for input in self.controls.refresh(self.size) {
            self.give(input);
        }
    }

    fn press_button(&mut self, drag: Drag, state: ElementState) {
        // The controls must know where the pointer is.
        self.refresh();
        let is_pressed = state == ElementState::Pressed;
        let is_theirs = self.controls.wants_pointer();
        if drag == Drag::Orbit {
            self.controls.click(is_pressed);
            self.refresh();
        }
        if !is_pressed {
            self.buttons.remove(&drag);
            if let Some(at) = self.pressed.take().filter(|_| drag == Drag::Orbit) {
                self.send(Input::Focus(at));
            }
        } else if !is_theirs {
            self.buttons.insert(drag);
            self.pressed = self.pointer.filter(|_| drag == Drag::Orbit);
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
        self.controls.point(to);
        self.is_due = true;
        if let Some([x, y]) = self.pressed {
            if (x - to[0]).abs().max((y - to[1]).abs()) < CLICK_WAY {
                return;
            }
            self.pressed = None;
        }
        let from = self.pointer.replace(to).unwrap_or(to);
        let height = self.size[1].max(1);
        let way = [0, 1].map(|axis| ((to[axis] - from[axis]) / f64::from(height)) as f32);
        let input = match self.buttons.first() {
            None if self.controls.wants_pointer() => return,
            None => Input::Pointer(to),
            Some(_) if way == [0.0; 2] => return,
            Some(drag) => Input::Drag(*drag, way),
        };
        self.send(input);
    }
}

impl ApplicationHandler<Report> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if let Err(error) = self.open(event_loop) {
            self.failure = Some(error);
            event_loop.exit();
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, report: Report) {
        match report {
            Report::Status(status) => {
                if let Some(window) = &self.window {
                    window.set_title(&status.title);
                }
                self.controls.report(*status);
                self.is_stale = true;
            }
            Report::Ended => event_loop.exit(),
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if self.is_due || (self.is_stale && self.drawn_at.elapsed() >= FOLLOWING) {
            self.refresh();
        }
        event_loop.set_control_flow(if self.is_stale {
            ControlFlow::WaitUntil(self.drawn_at + FOLLOWING)
        } else {
            ControlFlow::Wait
        });
    }

    fn window_event(&mut self, _event_loop: &ActiveEventLoop, _id: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => self.send(Input::Close),
            WindowEvent::Resized(size) => {
                self.size = size.into();
                self.send(Input::Resized(self.size));
                self.is_due = true;
            }
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
                self.press_button(drag, state);
            }
            WindowEvent::MouseWheel { delta, .. } => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => lines,
                    MouseScrollDelta::PixelDelta(way) => (way.y / PIXELS_PER_NOTCH) as f32,
                };
                if self.controls.wants_pointer() {
                    self.controls.scroll(notches * PIXELS_PER_NOTCH as f32);
                    self.is_due = true;
                } else if notches != 0.0 {
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
    (window, size): (Arc<Window>, [u32; 2]),
    proxy: EventLoopProxy<Report>,
) -> Result<()> {
    let Options { device: wanted, tracer, validate, check, settings, spp, tone } = options;
    let display = window.display_handle().map_err(|error| no_window(&error))?.as_raw();
    let device = Device::open_checked(wanted.as_deref(), validate, tracer, Some(display), check)?;
    let projector = Projector::new(&device, [scene.film.width, scene.film.height])?;
    // Show the scene by the sampler with the fewest kernels; the worker goes on with the one asked for.
    let first = Settings { sampler: Sampler::Mis, ..settings.clone() };
    let left = Side::new(&device, &scene, None, &first, None)?;
    let panel = Panel::new(&device, window, size, projector, inputs, tone)?;
    let panel = Rc::new(RefCell::new(panel));
    let announce = Box::new(move |status| {
        let _ = proxy.send_event(Report::Status(Box::new(status)));
    });
    let mut worker = Worker::new(scene, Arc::clone(&device), settings, spp, left, panel, announce);
    let result = worker.run();
    device.save_pipeline_cache();
    drop(worker);
    result.and_then(|()| device.check_validation())
}
