//! Live image in the viewer tev: the film so far → packets over TCP.
//!
//! tev's protocol (Müller, `Ipc.cpp` of <https://github.com/Tom94/tev>): little-endian packets of a
//! 32-bit length that counts itself, an 8-bit operation and its payload; strings end with a zero
//! byte. Two operations are used: `CreateImage` and `UpdateImageV3`. tev never answers.

use std::{
    io::Write,
    net::{TcpStream, ToSocketAddrs},
    time::{Duration, Instant},
};

use crate::error::{Error, Result};

/// Port that tev listens on by default.
pub const DEFAULT_PORT: u16 = 14158;

/// Operation that opens an image by name, replacing one of the same name.
const CREATE_IMAGE: u8 = 4;
/// Operation that replaces a rectangle of an image; offset and stride locate each channel's floats.
const UPDATE_IMAGE_V3: u8 = 6;

/// Names of the channels sent.
const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Time limit for a connection, and for the viewer to take one packet.
const TIMEOUT: Duration = Duration::from_secs(2);

/// Largest number of pixels in one packet: 3 MiB.
const PACKET_PIXELS: usize = 1 << 18;

/// Image shown by a display server. A server that is absent or goes away costs one warning in the
/// log; rendering continues.
#[derive(Debug)]
pub struct DisplayServer {
    stream: Option<TcpStream>,
    address: String,
    image_name: String,
    width: u32,
    height: u32,
}

impl DisplayServer {
    /// Connects to the server at `address` (`host:port`, or `host` for [`DEFAULT_PORT`]) and opens
    /// an image of the given name and size there.
    ///
    /// # Errors
    /// [`Error::Usage`] if `address` lacks a host or has an impossible port, not if none answers.
    pub fn connect(address: &str, image_name: &str, width: u32, height: u32) -> Result<Self> {
        let address = complete_address(address)?;
        let mut server = Self {
            stream: None,
            address,
            // A zero byte would end the name early.
            image_name: image_name.replace('\0', ""),
            width,
            height,
        };
        match open(&server.address) {
            Ok(stream) => {
                server.stream = Some(stream);
                let mut packet = Packet::new(CREATE_IMAGE);
                packet.grab_focus(true);
                packet.string(&server.image_name);
                packet.integers(&[server.width, server.height, CHANNELS.len() as u32]);
                CHANNELS.iter().for_each(|channel| packet.string(channel));
                server.send(packet);
            }
            Err(error) => log::warn!(
                "no display server at {}: {error}; rendering without (is tev running?)",
                server.address
            ),
        }
        Ok(server)
    }

    /// Tests whether the server is still connected; only then do images need preparing.
    pub fn is_connected(&self) -> bool {
        self.stream.is_some()
    }

    /// Shows `pixels`: linear Rec.709, row by row from the top.
    ///
    /// # Panics
    /// `pixels` is not `width * height` long.
    pub fn update(&mut self, pixels: &[[f32; 3]]) {
        assert_eq!(
            pixels.len(),
            self.width as usize * self.height as usize,
            "one pixel for each of {}×{}",
            self.width,
            self.height
        );
        let band_height = (PACKET_PIXELS / self.width.max(1) as usize).max(1);
        for (band, pixels) in pixels.chunks(band_height * self.width.max(1) as usize).enumerate() {
            if self.stream.is_none() {
                return;
            }
            let first_row = (band * band_height) as u32;
            let rows = (pixels.len() / self.width as usize) as u32;
            let mut packet = Packet::new(UPDATE_IMAGE_V3);
            packet.grab_focus(false);
            packet.string(&self.image_name);
            packet.integers(&[CHANNELS.len() as u32]);
            CHANNELS.iter().for_each(|channel| packet.string(channel));
            packet.integers(&[0, first_row, self.width, rows]);
            // Offset of each channel's first value, then the stride to its next, in floats.
            for value in [0_i64, 1, 2, 3, 3, 3] {
                packet.bytes.extend(value.to_le_bytes());
            }
            for value in pixels.as_flattened() {
                packet.bytes.extend(value.to_le_bytes());
            }
            self.send(packet);
        }
    }

    /// Sends a packet; on failure, warns and closes the connection.
    fn send(&mut self, packet: Packet) {
        let Some(stream) = &mut self.stream else { return };
        if let Err(error) = write_in_time(stream, &packet.finish()) {
            log::warn!("the display server at {} is gone: {error}", self.address);
            self.stream = None;
        }
    }
}

/// Completes `address` to `host:port`, with the default port if it names none.
fn complete_address(address: &str) -> Result<String> {
    let refuse = || {
        Error::usage(format!(
            "display server {address:?}: expected host or host:port, as in 127.0.0.1:{DEFAULT_PORT}"
        ))
    };
    // The last colon separates the port, unless it lies within the brackets of an IPv6 address.
    let (host, port) = match address.rsplit_once(':') {
        Some((host, port)) if !port.contains(']') => (host, Some(port)),
        _ => (address, None),
    };
    let port = port.map_or(Ok(DEFAULT_PORT), |port| port.parse().map_err(|_| refuse()))?;
    if host.is_empty() || port == 0 {
        return Err(refuse());
    }
    Ok(format!("{host}:{port}"))
}

/// Connects to the first address that answers, with time limits on connecting and writing.
fn open(address: &str) -> std::io::Result<TcpStream> {
    let mut failure = std::io::Error::other("the host has no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, TIMEOUT) {
            Ok(stream) => {
                stream.set_write_timeout(Some(TIMEOUT))?;
                return Ok(stream);
            }
            Err(error) => failure = error,
        }
    }
    Err(failure)
}

/// Writes all of `bytes` within about [`TIMEOUT`]. The limit on a single write is not enough: with
/// a stalled reader, the system still takes a few bytes now and then.
fn write_in_time(stream: &mut TcpStream, bytes: &[u8]) -> std::io::Result<()> {
    let start = Instant::now();
    let mut rest = bytes;
    while !rest.is_empty() {
        let written = stream.write(rest)?;
        rest = &rest[written..];
        if written == 0 || (!rest.is_empty() && start.elapsed() > TIMEOUT) {
            return Err(std::io::Error::new(std::io::ErrorKind::TimedOut, "it takes no data"));
        }
    }
    Ok(())
}

/// A packet under construction; its first four bytes are the length.
struct Packet {
    bytes: Vec<u8>,
}

impl Packet {
    fn new(operation: u8) -> Self {
        Self { bytes: vec![0, 0, 0, 0, operation] }
    }

    /// Appends the flag that makes the viewer bring the image to the front.
    fn grab_focus(&mut self, grab: bool) {
        self.bytes.push(u8::from(grab));
    }

    fn string(&mut self, text: &str) {
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }

    fn integers(&mut self, values: &[u32]) {
        values.iter().for_each(|value| self.bytes.extend(value.to_le_bytes()));
    }

    fn finish(mut self) -> Vec<u8> {
        let length = self.bytes.len() as u32;
        self.bytes[..4].copy_from_slice(&length.to_le_bytes());
        self.bytes
    }
}
