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

use super::Image;
use crate::error::{Error, Result};

/// Port that tev listens on by default.
pub(crate) const DEFAULT_PORT: u16 = 14158;

/// Operation that opens an image by name, replacing one of the same name.
const CREATE_IMAGE: u8 = 4;
/// Operation that replaces a rectangle of an image; offset and stride locate each channel's floats.
const UPDATE_IMAGE_V3: u8 = 6;

/// Time limit for a connection, and for the viewer to take one packet.
const TIMEOUT: Duration = Duration::from_secs(2);

/// Largest number of values in one packet, if a row has no more: 3 MiB.
const PACKET_VALUES: usize = 3 << 18;

/// Image shown by a display server. A server that is absent or goes away costs one warning in the
/// log; rendering continues.
#[derive(Debug)]
pub struct DisplayServer {
    stream: Option<TcpStream>,
    address: String,
    image_name: String,
    is_open: bool,
}

impl DisplayServer {
    /// Connects to the server at `address` (`host:port`, or `host` for [`DEFAULT_PORT`]), to show an image
    /// of this name.
    ///
    /// # Errors
    /// [`Error::Usage`] if `address` lacks a host or has an impossible port, not if none answers.
    pub fn connect(address: &str, image_name: &str) -> Result<Self> {
        let address = complete_address(address)?;
        let mut server = Self {
            stream: None,
            address,
            // A zero byte would end the name early.
            image_name: image_name.replace('\0', ""),
            is_open: false,
        };
        match open(&server.address) {
            Ok(stream) => server.stream = Some(stream),
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

    /// Shows all channels of `image`, the picture first; names with a dot make layers in the viewer. Every
    /// image must have the size and channels of the first.
    pub fn update(&mut self, image: &Image) {
        let is_picture = |name: &str| matches!(name, "R" | "G" | "B");
        let picture = ["R", "G", "B"].into_iter().filter(|name| image.channels.contains_key(*name));
        let others = image.channels.keys().map(String::as_str).filter(|name| !is_picture(name));
        let names: Vec<&str> = picture.chain(others).collect();
        if names.is_empty() || image.pixel_count() == 0 {
            return;
        }
        if !self.is_open {
            let mut packet = Packet::new(CREATE_IMAGE, true, &self.image_name);
            packet.integers(&[image.width, image.height, names.len() as u32]);
            names.iter().for_each(|name| packet.string(name));
            self.send(packet);
            self.is_open = true;
        }
        let width = image.width as usize;
        let band_height = (PACKET_VALUES / (width * names.len())).max(1);
        for first_row in (0..image.height as usize).step_by(band_height) {
            if self.stream.is_none() {
                return;
            }
            let rows = band_height.min(image.height as usize - first_row);
            let mut packet = Packet::new(UPDATE_IMAGE_V3, false, &self.image_name);
            packet.integers(&[names.len() as u32]);
            names.iter().for_each(|name| packet.string(name));
            packet.integers(&[0, first_row as u32, image.width, rows as u32]);
            // Offset of each channel's first value, then the stride to its next, in floats.
            let offsets = (0..names.len()).map(|channel| channel * rows * width);
            for value in offsets.chain(names.iter().map(|_| 1)) {
                packet.bytes.extend((value as i64).to_le_bytes());
            }
            for name in &names {
                let samples = &image.channels[*name][first_row * width..][..rows * width];
                packet.bytes.extend(samples.iter().flat_map(|value| value.to_le_bytes()));
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
    /// Starts the packet of an operation on an image; `focus` brings the image to the front.
    fn new(operation: u8, focus: bool, image_name: &str) -> Self {
        let mut packet = Self { bytes: vec![0, 0, 0, 0, operation, u8::from(focus)] };
        packet.string(image_name);
        packet
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
