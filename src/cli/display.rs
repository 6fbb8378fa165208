//! A picture in the making, in the viewer tev (T. Müller's, by its protocol: packets over TCP, as its `src/Ipc.cpp` has
//! them).
//!
//! Packets are sent by a thread of their own, so that a slow viewer does not hold up the render. What waits to be sent
//! is at most the picture, one of each engine: of a tile that is done again before it was sent, the newest packet. A
//! viewer that goes away during the render is told of at the end, and costs the picture nothing.

use std::collections::BTreeMap;
use std::io::Write;
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::error::{Error, Result, Warning};
use crate::render::Finished;

/// The longest that the viewer may take for anything.
const PATIENCE: Duration = Duration::from_secs(10);

/// Makes an image, or makes it anew.
const CREATE_IMAGE: u8 = 4;
/// Replaces a part of an image; with offsets and strides for each channel (tev's version 3 of it).
const UPDATE_IMAGE: u8 = 6;

const CHANNELS: [&str; 4] = ["R", "G", "B", "A"];

/// A viewer that listens.
pub(super) struct Display {
    address: String,
    /// What images are called, but for the engine.
    title: String,
    queue: Arc<Queue>,
    thread: Option<JoinHandle<std::io::Result<()>>>,
}

/// What is to be sent, and whoever waits for it.
#[derive(Default)]
struct Queue {
    state: Mutex<PendingUpdate>,
    changed: Condvar,
}

#[derive(Default)]
struct PendingUpdate {
    /// The image that is shown, and its number.
    name: String,
    image: u32,
    /// In the order in which they are sent.
    packets: BTreeMap<Place, Vec<u8>>,
    /// Whether nothing more comes, or nothing more can be sent.
    is_over: bool,
}

/// What a packet is about: of the image with this number the tile at (y, x), or the whole.
type Place = (u32, Option<[u32; 2]>);

impl Queue {
    fn lock(&self) -> MutexGuard<'_, PendingUpdate> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// In place of what is still waiting about the same.
    fn put(&self, mut waiting: MutexGuard<'_, PendingUpdate>, tile: Option<[u32; 2]>, packet: Packet) {
        if !waiting.is_over {
            let place = (waiting.image, tile);
            waiting.packets.insert(place, packet.finished());
            self.changed.notify_one();
        }
    }

    /// The next, once there is one; none after the last.
    fn next(&self) -> Option<Vec<u8>> {
        let mut waiting = self.lock();
        loop {
            match waiting.packets.pop_first() {
                Some((_, packet)) => return Some(packet),
                None if waiting.is_over => return None,
                None => waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    fn end(&self) {
        self.lock().is_over = true;
        self.changed.notify_one();
    }

    fn send_all(&self, stream: &mut TcpStream) -> std::io::Result<()> {
        let sent = std::iter::from_fn(|| self.next()).try_for_each(|packet| stream.write_all(&packet));
        if sent.is_err() {
            *self.lock() = PendingUpdate { is_over: true, ..PendingUpdate::default() };
        }
        sent
    }
}

impl Display {
    /// Finds the viewer at HOST:PORT.
    ///
    /// # Errors
    /// [`Error::Backend`] where nothing listens there.
    pub(super) fn connect(address: &str, title: String) -> Result<Self> {
        let mut stream = connect(address).map_err(|error| Error::Backend {
            backend: "display server",
            message: format!("{address} cannot be reached ({error}): start tev there, or leave out --display-server"),
        })?;
        let queue = Arc::<Queue>::default();
        let sent = Arc::clone(&queue);
        let thread = Some(std::thread::spawn(move || sent.send_all(&mut stream)));
        Ok(Self { address: address.to_owned(), title, queue, thread })
    }

    /// Shows an empty picture, by the engine that is to fill it.
    pub(super) fn begin(&self, engine: &str, [width, height]: [u32; 2]) {
        let name = format!("{} by {engine}", self.title);
        let mut packet = Packet::new(CREATE_IMAGE, true, &name);
        packet.numbers([width, height, CHANNELS.len() as u32]);
        CHANNELS.iter().for_each(|channel| packet.text(channel));
        let mut waiting = self.queue.lock();
        waiting.name = name;
        waiting.image += 1;
        self.queue.put(waiting, None, packet);
    }

    /// Shows pixels that are done.
    pub(super) fn show(&self, finished: &Finished) {
        let name = self.queue.lock().name.clone();
        let mut packet = Packet::new(UPDATE_IMAGE, false, &name);
        packet.numbers([CHANNELS.len() as u32]);
        CHANNELS.iter().for_each(|channel| packet.text(channel));
        packet.numbers([finished.x, finished.y, finished.width, finished.height()]);
        // In floats: where each channel begins, and from pixel to pixel.
        packet.long_numbers([0, 1, 2, 3]);
        packet.long_numbers([4; 4]);
        for value in finished.pixels.iter().flat_map(|pixel| pixel.to_array()) {
            packet.0.extend(value.to_le_bytes());
        }
        self.queue.put(self.queue.lock(), Some([finished.y, finished.x]), packet);
    }

    /// Waits until everything is shown; a warning where it was not.
    pub(super) fn finish(mut self) -> Option<Warning> {
        self.queue.end();
        let lost = match self.thread.take()?.join() {
            Ok(Ok(())) => return None,
            Ok(Err(error)) => error.to_string(),
            Err(_) => "it failed".to_owned(),
        };
        let message = format!("did not show all of the picture: {lost}");
        Some(Warning::new("--display-server", self.address.clone(), message))
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        self.queue.end();
    }
}

fn connect(address: &str) -> std::io::Result<TcpStream> {
    let mut refused = None;
    for place in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&place, PATIENCE) {
            Ok(stream) => {
                stream.set_write_timeout(Some(PATIENCE))?;
                stream.set_nodelay(true)?;
                return Ok(stream);
            }
            Err(error) => refused = Some(error),
        }
    }
    Err(refused.unwrap_or_else(|| std::io::Error::other("the name stands for no address")))
}

/// A packet: its length in bytes, this number included, then what it is; all numbers little-endian, texts end with a 0.
struct Packet(Vec<u8>);

impl Packet {
    /// What kind, whether the viewer is to turn to the image, and which.
    fn new(kind: u8, grab_focus: bool, name: &str) -> Self {
        let mut packet = Self(vec![0, 0, 0, 0, kind, u8::from(grab_focus)]);
        packet.text(name);
        packet
    }

    fn text(&mut self, text: &str) {
        self.0.extend(text.bytes().filter(|&byte| byte != 0).chain([0]));
    }

    fn numbers<const N: usize>(&mut self, numbers: [u32; N]) {
        self.0.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    }

    fn long_numbers<const N: usize>(&mut self, numbers: [u64; N]) {
        self.0.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    }

    fn finished(mut self) -> Vec<u8> {
        // A tile is a few kilobytes.
        let length = (self.0.len() as u32).to_le_bytes();
        self.0[..4].copy_from_slice(&length);
        self.0
    }
}

/// HOST:PORT.
pub(super) fn parse_address(text: &str) -> std::result::Result<String, String> {
    let port =
        text.rsplit_once(':').filter(|(host, _)| !host.is_empty()).and_then(|(_, port)| port.parse::<u16>().ok());
    port.filter(|&port| port > 0)
        .map(|_| text.to_owned())
        .ok_or_else(|| "expected HOST:PORT, as in localhost:14158, where tev listens".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_are_tevs() {
        let mut packet = Packet::new(CREATE_IMAGE, true, "ab");
        packet.numbers([3, 2, 1]);
        packet.text("R");
        let bytes = [&[23u8, 0, 0, 0, 4, 1, b'a', b'b', 0][..], &[3, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0], &[b'R', 0]];
        assert_eq!(packet.finished(), bytes.concat());
    }

    /// What comes again before it was sent takes the place of what came before; an image comes before its tiles, and
    /// before the next.
    #[test]
    fn the_newest_of_each_tile_waits() {
        let queue = Queue::default();
        let packet = |letter: &str| Packet::new(UPDATE_IMAGE, false, letter);
        for (image, tile, letter) in
            [(1, None, "a"), (1, Some([8, 0]), "b"), (1, Some([0, 8]), "c"), (1, Some([8, 0]), "d"), (2, None, "e")]
        {
            let mut waiting = queue.lock();
            waiting.image = image;
            queue.put(waiting, tile, packet(letter));
        }
        queue.end();
        let sent: Vec<Vec<u8>> = std::iter::from_fn(|| queue.next()).collect();
        assert_eq!(sent, ["a", "c", "d", "e"].map(|letter| packet(letter).finished()));
        queue.put(queue.lock(), None, packet("f"));
        assert!(queue.next().is_none(), "nothing waits for who is gone");
    }

    #[test]
    fn addresses() {
        for good in ["localhost:14158", "[::1]:80", "10.0.0.1:1"] {
            assert_eq!(parse_address(good), Ok(good.to_owned()));
        }
        for bad in ["", "localhost", ":14158", "host:", "host:0", "host:65536", "host:tev"] {
            assert!(parse_address(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn nobody_there_is_told_with_a_remedy() {
        // A port that was free a moment ago.
        let port = std::net::TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("its number").port();
        let refused = Display::connect(&format!("127.0.0.1:{port}"), String::new()).err().expect("nobody listens");
        assert_eq!(refused.exit_code(), 3);
        assert!(refused.to_string().contains("start tev"), "{refused}");
    }
}
