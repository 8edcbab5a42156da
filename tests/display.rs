//! The display server's client, against a listener that reads tev's protocol.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{
    io::Read,
    net::TcpListener,
    thread,
    time::{Duration, Instant},
};

use fenestra::film::{DisplayServer, Image};

use crate::support::command::{BALL, Folder, yard};

/// Reads a packet field by field, as a server would.
struct Packet(std::io::Cursor<Vec<u8>>);

impl Packet {
    fn receive(stream: &mut impl Read) -> Option<Self> {
        let mut length = [0; 4];
        stream.read_exact(&mut length).ok()?;
        let mut payload = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut payload).expect("a packet is as long as it says");
        Some(Self(std::io::Cursor::new(payload)))
    }

    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        self.0.read_exact(&mut bytes).unwrap();
        bytes
    }

    fn byte(&mut self) -> u8 {
        self.bytes::<1>()[0]
    }

    fn integer(&mut self) -> i32 {
        i32::from_le_bytes(self.bytes())
    }

    fn string(&mut self) -> String {
        let bytes = std::iter::repeat_with(|| self.byte()).take_while(|byte| *byte != 0);
        String::from_utf8(bytes.collect()).unwrap()
    }

    fn is_at_end(&self) -> bool {
        self.0.position() as usize == self.0.get_ref().len()
    }
}

/// Image shown by a server.
#[derive(Debug, PartialEq)]
struct Shown {
    name: String,
    size: [i32; 2],
    channels: Vec<String>,
    /// Samples of each channel.
    samples: Vec<Vec<f32>>,
    updates: usize,
}

/// Accepts one client and returns what it shows in the end.
fn serve(listener: &TcpListener) -> Shown {
    let (mut stream, _) = listener.accept().unwrap();
    let mut packet = Packet::receive(&mut stream).expect("a first packet");
    assert_eq!(packet.byte(), 4, "the first packet creates the image");
    assert_eq!(packet.byte(), 1, "and brings it to the front");
    let name = packet.string();
    let size = [packet.integer(), packet.integer()];
    let count = packet.integer();
    let channels: Vec<String> = (0..count).map(|_| packet.string()).collect();
    assert!(packet.is_at_end());
    let samples = vec![vec![f32::NAN; (size[0] * size[1]) as usize]; channels.len()];
    let mut shown = Shown { name, size, channels, samples, updates: 0 };
    while let Some(mut packet) = Packet::receive(&mut stream) {
        assert_eq!(packet.byte(), 6, "later packets update it");
        assert_eq!(packet.byte(), 0, "without bringing it to the front");
        assert_eq!(packet.string(), shown.name);
        let count = packet.integer();
        let names: Vec<String> = (0..count).map(|_| packet.string()).collect();
        assert_eq!(names, shown.channels);
        let [x, y, width, height] = [(); 4].map(|()| packet.integer());
        let mut places =
            || (0..count).map(|_| i64::from_le_bytes(packet.bytes()) as usize).collect::<Vec<_>>();
        let (offsets, strides) = (places(), places());
        let mut data = Vec::new();
        while !packet.is_at_end() {
            data.push(f32::from_le_bytes(packet.bytes()));
        }
        for index in 0..(width * height) as usize {
            let (column, row) = (index as i32 % width, index as i32 / width);
            let pixel = ((y + row) * size[0] + x + column) as usize;
            for (channel, samples) in shown.samples.iter_mut().enumerate() {
                samples[pixel] = data[offsets[channel] + index * strides[channel]];
            }
        }
        assert_eq!(data.len(), (width * height * count) as usize, "no data is left over");
        shown.updates += usize::from(y == 0);
    }
    shown
}

/// Starts a server; returns its address too.
fn start() -> (String, thread::JoinHandle<Shown>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    (address, thread::spawn(move || serve(&listener)))
}

fn image(width: u32, height: u32, pass: f32) -> Image {
    let mut image = Image::new(width, height);
    let pixels: Vec<[f32; 3]> =
        (0..width * height).map(|index| [index as f32, pass, -0.5]).collect();
    image.insert_triple(["R", "G", "B"], &pixels);
    image.channels.insert("Visible.Y".into(), vec![0.25 * pass; image.pixel_count()]);
    image
}

#[test]
fn the_server_shows_the_last_update() {
    // The second size needs several packets.
    for (width, height) in [(5_u32, 3_u32), (2000, 1100)] {
        let (address, server) = start();
        let mut display = DisplayServer::connect(&address, "kitchen").unwrap();
        assert!(display.is_connected());
        display.update(&image(width, height, 1.0));
        display.update(&image(width, height, 2.0));
        drop(display);
        let shown = server.join().unwrap();
        assert_eq!(shown.name, "kitchen");
        assert_eq!(shown.size, [width as i32, height as i32]);
        assert_eq!(shown.channels, ["R", "G", "B", "Visible.Y"]);
        let expected = image(width, height, 2.0);
        for (name, samples) in shown.channels.iter().zip(&shown.samples) {
            assert!(*samples == expected.channels[name], "{name}");
        }
    }
}

#[test]
fn a_short_render_shows_its_last_film_and_layers() {
    let folder = Folder::new();
    let clay = "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]";
    folder.write("yard.toml", yard([16, 12], "constant = [1, 1, 1]", clay, BALL));
    for sampler in ["mis", "cosine"] {
        let (address, server) = start();
        let arguments = ["render", "yard.toml", "--sampler", sampler, "--depth", "1", "--spp", "2"];
        let more = ["--aov", "albedo,variance", "-o", "out.exr", "--display-server", &address];
        folder.run(&[&arguments[..], &more[..]].concat()).assert(0, &[]);
        let shown = server.join().unwrap();
        assert_eq!(shown.name, format!("out.exr ({sampler})"));
        let written = folder.image("out.exr");
        assert_eq!(shown.channels[..4], ["R", "G", "B", "Albedo.B"]);
        assert_eq!(shown.channels.len(), written.channels.len());
        for (name, samples) in shown.channels.iter().zip(&shown.samples) {
            assert!(*samples == written.channels[name], "{name}");
        }
    }
}

#[test]
fn a_missing_server_is_no_error() {
    // This port was free a moment ago.
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let mut display = DisplayServer::connect(&address, "image").unwrap();
    assert!(!display.is_connected());
    display.update(&image(2, 2, 0.0));
    let display = DisplayServer::connect("no-such-host.invalid", "image").unwrap();
    assert!(!display.is_connected());
}

#[test]
fn a_server_that_leaves_or_stalls_is_given_up() {
    let image = image(2000, 2000, 1.0);
    for leaves in [true, false] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let mut display = DisplayServer::connect(&address, "image").unwrap();
        let (stream, _) = listener.accept().unwrap();
        let held = if leaves { None } else { Some(stream) };
        let start = Instant::now();
        display.update(&image);
        display.update(&image);
        assert!(!display.is_connected());
        assert!(start.elapsed() < Duration::from_secs(20));
        drop(held);
    }
}

#[test]
fn an_impossible_address_is_wrong_usage() {
    for address in ["", ":14158", "localhost:tev", "localhost:99999", "localhost:0", "[::1]:x"] {
        let error = DisplayServer::connect(address, "image").unwrap_err();
        assert_eq!(error.exit_status(), 2, "{address}");
        assert!(error.to_string().contains(&format!("{address:?}")), "{error}");
    }
}
