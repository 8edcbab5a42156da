//! The display server's client, against a listener that reads tev's protocol.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{
    io::Read,
    net::TcpListener,
    thread,
    time::{Duration, Instant},
};

use fenestra::film::DisplayServer;

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

/// Accepts one client and returns the name, size and pixels shown in the end.
fn serve(listener: &TcpListener) -> (String, [i32; 2], Vec<[f32; 3]>) {
    let (mut stream, _) = listener.accept().unwrap();
    let mut packet = Packet::receive(&mut stream).expect("a first packet");
    assert_eq!(packet.byte(), 4, "the first packet creates the image");
    assert_eq!(packet.byte(), 1, "and brings it to the front");
    let name = packet.string();
    let size = [packet.integer(), packet.integer()];
    let channels = packet.integer();
    let names: Vec<String> = (0..channels).map(|_| packet.string()).collect();
    assert_eq!(names, ["R", "G", "B"]);
    assert!(packet.is_at_end());
    let mut pixels = vec![[f32::NAN; 3]; (size[0] * size[1]) as usize];
    while let Some(mut packet) = Packet::receive(&mut stream) {
        assert_eq!(packet.byte(), 6, "later packets update it");
        assert_eq!(packet.byte(), 0, "without bringing it to the front");
        assert_eq!(packet.string(), name);
        let channels = packet.integer();
        let names: Vec<String> = (0..channels).map(|_| packet.string()).collect();
        assert_eq!(names, ["R", "G", "B"]);
        let [x, y, width, height] = [(); 4].map(|()| packet.integer());
        let offsets = [(); 3].map(|()| i64::from_le_bytes(packet.bytes()) as usize);
        let strides = [(); 3].map(|()| i64::from_le_bytes(packet.bytes()) as usize);
        let mut data = Vec::new();
        while !packet.is_at_end() {
            data.push(f32::from_le_bytes(packet.bytes()));
        }
        for index in 0..(width * height) as usize {
            let (column, row) = (index as i32 % width, index as i32 / width);
            let pixel = &mut pixels[((y + row) * size[0] + x + column) as usize];
            for channel in 0..3 {
                pixel[channel] = data[offsets[channel] + index * strides[channel]];
            }
        }
        let last = offsets[2] + ((width * height) as usize - 1) * strides[2];
        assert_eq!(data.len(), last + 1, "no data is left over");
    }
    (name, size, pixels)
}

#[test]
fn the_server_shows_the_last_update() {
    // The second size needs several packets.
    for (width, height) in [(5_u32, 3_u32), (2000, 1100)] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let server = thread::spawn(move || serve(&listener));
        let image = |pass: f32| -> Vec<[f32; 3]> {
            (0..width * height).map(|index| [index as f32, pass, -0.5]).collect()
        };
        let mut display = DisplayServer::connect(&address, "kitchen", width, height).unwrap();
        assert!(display.is_connected());
        display.update(&image(1.0));
        display.update(&image(2.0));
        drop(display);
        let (name, size, pixels) = server.join().unwrap();
        assert_eq!(name, "kitchen");
        assert_eq!(size, [width as i32, height as i32]);
        assert!(pixels == image(2.0));
    }
}

#[test]
fn a_missing_server_is_no_error() {
    // This port was free a moment ago.
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let mut display = DisplayServer::connect(&address, "image", 2, 2).unwrap();
    assert!(!display.is_connected());
    display.update(&[[0.0; 3]; 4]);
    let display = DisplayServer::connect("no-such-host.invalid", "image", 2, 2).unwrap();
    assert!(!display.is_connected());
}

#[test]
fn a_server_that_leaves_or_stalls_is_given_up() {
    let pixels = vec![[1.0; 3]; 2000 * 2000];
    for leaves in [true, false] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let mut display = DisplayServer::connect(&address, "image", 2000, 2000).unwrap();
        let (stream, _) = listener.accept().unwrap();
        let held = if leaves { None } else { Some(stream) };
        let start = Instant::now();
        display.update(&pixels);
        display.update(&pixels);
        assert!(!display.is_connected());
        assert!(start.elapsed() < Duration::from_secs(20));
        drop(held);
    }
}

#[test]
fn an_impossible_address_is_wrong_usage() {
    for address in ["", ":14158", "localhost:tev", "localhost:99999", "localhost:0", "[::1]:x"] {
        let error = DisplayServer::connect(address, "image", 1, 1).unwrap_err();
        assert_eq!(error.exit_status(), 2, "{address}");
        assert!(error.to_string().contains(&format!("{address:?}")), "{error}");
    }
}
