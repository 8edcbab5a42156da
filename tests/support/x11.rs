//! A virtual X server, and the program with a window on it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    io::{BufRead, BufReader, Read},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use x11rb::{
    connection::Connection,
    protocol::{
        xproto::{
            AtomEnum, BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ConfigureWindowAux,
            ConnectionExt as _, ImageFormat, InputFocus, KEY_PRESS_EVENT, KEY_RELEASE_EVENT,
            MapState, Window,
        },
        xtest::ConnectionExt as _,
    },
    rust_connection::RustConnection,
};

use super::command::{Folder, Run, end_of, program};

/// Longest wait for anything: a first render compiles its pipelines, on a machine that may be busy.
const LONGEST: Duration = Duration::from_secs(120);
/// Time after which a key is taken for lost.
const LOST: Duration = Duration::from_secs(10);
const POLL: Duration = Duration::from_millis(20);

/// An X server without a screen.
pub struct Server {
    child: Child,
    display: String,
}

impl Server {
    /// Starts the server.
    ///
    /// # Panics
    /// Without Xvfb: run `./setup`.
    pub fn start() -> Self {
        let mut child = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x1024x24"])
            .args(["-nolisten", "tcp", "-noreset"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|error| panic!("tests of the window need Xvfb, run ./setup: {error}"));
        let mut number = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut number).unwrap();
        assert!(!number.trim().is_empty(), "Xvfb ended: run ./setup, which installs its parts");
        Self { child, display: format!(":{}", number.trim()) }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// `fenestra view` and its window.
pub struct View<'a> {
    child: Child,
    connection: RustConnection,
    root: Window,
    window: Window,
    folder: &'a Folder,
}

impl<'a> View<'a> {
    /// Starts the program on a scene and waits for its window.
    pub fn open(
        server: &Server,
        folder: &'a Folder,
        scene: &str,
        options: &[&str],
        size: [u32; 2],
    ) -> Self {
        Self::open_with(server, folder, scene, options, size, |_| ())
    }

    /// As [`View::open`], after `prepare` has seen the command.
    pub fn open_with(
        server: &Server,
        folder: &'a Folder,
        scene: &str,
        options: &[&str],
        [width, height]: [u32; 2],
        prepare: impl FnOnce(&mut Command),
    ) -> Self {
        let (connection, screen) = RustConnection::connect(Some(&server.display)).unwrap();
        let root = connection.setup().roots[screen].root;
        let mut command = program(folder.path());
        command
            .args(["view", scene])
            .args(options)
            .env("DISPLAY", &server.display)
            .env_remove("WAYLAND_DISPLAY")
            .stderr(Stdio::piped());
        prepare(&mut command);
        let child = command.spawn().unwrap();
        let mut view = Self { child, connection, root, window: 0, folder };
        let start = Instant::now();
        while view.window == 0 {
            view.assert_running(start, "its window");
            let windows = view.connection.query_tree(root).unwrap().reply().unwrap().children;
            let is_ours = |window: &Window| {
                let Ok(shape) = view.connection.get_geometry(*window).unwrap().reply() else {
                    return false;
                };
                let Ok(state) = view.connection.get_window_attributes(*window).unwrap().reply()
                else {
                    return false;
                };
                let size = [u32::from(shape.width), u32::from(shape.height)];
                state.map_state == MapState::VIEWABLE && size == [width, height]
            };
            view.window = windows.into_iter().find(is_ours).unwrap_or(0);
        }
        // Without a window manager nobody else gives it the keyboard.
        let focus =
            view.connection.set_input_focus(InputFocus::PARENT, view.window, x11rb::CURRENT_TIME);
        focus.unwrap().check().unwrap();
        view
    }

    #[track_caller]
    fn assert_running(&mut self, start: Instant, what: &str) {
        if self.child.try_wait().unwrap().is_some() || start.elapsed() > LONGEST {
            let title = if self.window == 0 { String::new() } else { self.title() };
            let _ = self.child.kill();
            let mut messages = String::new();
            self.child.stderr.take().unwrap().read_to_string(&mut messages).unwrap();
            panic!("waited in vain for {what}; title {title:?}; messages:\n{messages}");
        }
        thread::sleep(POLL);
    }

    #[track_caller]
    fn wait(&mut self, what: &str, is_met: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        while !is_met(self) {
            self.assert_running(start, what);
        }
    }

    /// Waits until `is_met`.
    #[track_caller]
    pub fn wait_until(&mut self, is_met: impl Fn(&Self) -> bool) {
        self.wait("the picture", is_met);
    }

    /// Waits until the title contains `text`.
    #[track_caller]
    pub fn wait_for(&mut self, text: &str) {
        self.wait(text, |view| view.title().contains(text));
    }

    /// Waits until the title contains `text` and the camera rests: a small film of one that moves soon has
    /// as many samples.
    #[track_caller]
    pub fn wait_at_rest(&mut self, text: &str) {
        let is_met = |title: &str| title.contains(text) && !title.contains("moving");
        self.wait(text, |view| is_met(&view.title()));
    }

    /// Waits until a file is there.
    #[track_caller]
    pub fn wait_for_file(&mut self, name: &str) {
        self.wait(name, |view| view.folder.path().join(name).exists());
    }

    /// Taps a key that writes a file until it is there: a busy display may lose one, but not each of them.
    #[track_caller]
    pub fn write_by(&mut self, key: &str, name: &str) {
        let (start, mut taps) = (Instant::now(), 0);
        while !self.folder.path().join(name).exists() {
            if start.elapsed() >= taps * LOST {
                self.tap(key);
                taps += 1;
            }
            self.assert_running(start, name);
        }
    }

    /// Title of the window.
    pub fn title(&self) -> String {
        let name =
            self.connection.intern_atom(false, b"_NET_WM_NAME").unwrap().reply().unwrap().atom;
        let property =
            self.connection.get_property(false, self.window, name, AtomEnum::ANY, 0, 1024).unwrap();
        property
            .reply()
            .map_or(String::new(), |property| String::from_utf8_lossy(&property.value).into_owned())
    }

    /// Presses and releases a key.
    pub fn tap(&self, key: &str) {
        self.press(key);
        self.release(key);
    }

    pub fn press(&self, key: &str) {
        self.send(KEY_PRESS_EVENT, self.key_code(key));
    }

    pub fn release(&self, key: &str) {
        self.send(KEY_RELEASE_EVENT, self.key_code(key));
    }

    fn key_code(&self, key: &str) -> u8 {
        let symbol = match key {
            "Escape" => 0xff1b,
            "Tab" => 0xff09,
            "Shift" => 0xffe1,
            // Symbols of Latin characters are their codes.
            character => u32::from(character.chars().next().unwrap()),
        };
        let setup = self.connection.setup();
        let (first, last) = (setup.min_keycode, setup.max_keycode);
        let mapping = self.connection.get_keyboard_mapping(first, last - first + 1).unwrap();
        let mapping = mapping.reply().unwrap();
        let per_code = usize::from(mapping.keysyms_per_keycode);
        let plain = mapping.keysyms.chunks(per_code).position(|symbols| symbols[0] == symbol);
        first + u8::try_from(plain.expect("a key of the keyboard")).unwrap()
    }

    fn send(&self, kind: u8, detail: u8) {
        let sent = self.connection.xtest_fake_input(kind, detail, 0, self.root, 0, 0, 0);
        sent.unwrap().check().unwrap();
    }

    /// Moves the pointer to a pixel of the window.
    pub fn point(&self, [x, y]: [i16; 2]) {
        let moved = self.connection.warp_pointer(x11rb::NONE, self.window, 0, 0, 0, 0, x, y);
        moved.unwrap().check().unwrap();
    }

    /// Presses a button of the pointer at a pixel of the window, and releases it at another: left, middle and
    /// right are 1 to 3, a notch of the wheel away from the user is 4.
    pub fn drag(&self, button: u8, from: [i16; 2], to: [i16; 2]) {
        self.point(from);
        self.send(BUTTON_PRESS_EVENT, button);
        self.point(to);
        self.send(BUTTON_RELEASE_EVENT, button);
    }

    /// Presses and releases the first button of the pointer at a pixel of the window.
    pub fn click(&self, at: [i16; 2]) {
        self.drag(1, at, at);
    }

    /// Gives the window another size, as a window manager does.
    pub fn resize(&self, [width, height]: [u32; 2]) {
        let size = ConfigureWindowAux::new().width(width).height(height);
        self.connection.configure_window(self.window, &size).unwrap().check().unwrap();
    }

    /// Returns the pixels of the window: red, green, blue.
    pub fn picture(&self, [width, height]: [u32; 2]) -> Vec<[u8; 3]> {
        let (width, height) = (width as u16, height as u16);
        let image = self
            .connection
            .get_image(ImageFormat::Z_PIXMAP, self.window, 0, 0, width, height, u32::MAX)
            .unwrap();
        let data = image.reply().map_or(Vec::new(), |image| image.data);
        data.chunks_exact(4).map(|pixel| [pixel[2], pixel[1], pixel[0]]).collect()
    }

    /// Waits for the end of the program.
    pub fn end(&mut self) -> Run {
        let status = end_of(&mut self.child, LONGEST);
        let mut messages = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut messages).unwrap();
        Run { status, output: String::new(), messages }
    }
}

impl Drop for View<'_> {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
