//! Flags about what a camera makes of light, and about looking closer, as a user meets them: the binary is run.

use std::io::Read;
use std::net::TcpListener;
use std::process::Output;

use twincast::Image;
use twincast::math::Vec4;

use crate::program::{text, twincast};

/// A red floor that glows with 0.25, 0.125, 0.0625 under a camera, and what is left of it black.
const SCENE: &str = "[render]\nsize = [40, 30]\nspp = 1\nheadlight = false\n[[camera]]\neye = [0, 5, 0]\nlook_at = [0, 0, 0]\n\
    [material.glow]\ndiffuse = 0\nemission = [0.25, 0.125, 0.0625]\n[[disk]]\ncentre = [0, 0, 0]\nnormal = [0, 1, 0]\nradius = 1.2\nmaterial = \"glow\"\n";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new(scene: &str) -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder"));
        std::fs::write(folder.path("scene.toml"), scene).expect("a file in it");
        folder
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().expect("UTF-8").to_owned()
    }

    fn render(&self, flags: &[&str]) -> Output {
        let scene = self.path("scene.toml");
        twincast(&[&["render", &scene][..], flags].concat())
    }

    fn image(&self, name: &str) -> Image {
        twincast::image::read(self.path(name).as_ref()).expect("a picture")
    }
}

#[test]
fn codes_are_developed_and_radiance_is_kept() {
    let folder = Folder::new(SCENE);
    let render = |flags: &[&str]| {
        let (png, exr) = (folder.path("a.png"), folder.path("a.exr"));
        let output = folder.render(&[&["-q", "-o", &png, "-o", &exr], flags].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let codes = ::image::open(folder.path("a.png")).expect("a PNG").into_rgba8().get_pixel(20, 15).0;
        assert_eq!(folder.image("a.exr").pixels[15 * 40 + 20], Vec4::new(0.25, 0.125, 0.0625, 1.0), "{flags:?}");
        [codes[0], codes[1], codes[2]]
    };
    // By hand: 255 (1.055 x^(1/2.4) - 0.055).
    assert_eq!(render(&[]), [137, 99, 71]);
    assert_eq!(render(&["--exposure", "1"]), [188, 137, 99]);
    assert_eq!(render(&["--exposure=-1"]), [99, 71, 49]);
    assert_eq!(render(&["--response", "linear", "--exposure", "1"]), [128, 64, 32]);
    // Hable's curve: f(0.5) / f(11.2) = 0.17197, f(0.25) / f(11.2) = 0.09164, f(0.125) / f(11.2) = 0.04718.
    assert_eq!(render(&["--response", "filmic"]), [115, 85, 61]);
    let [r, g, b] = render(&["--white-balance", "2000"]);
    assert!(b > 90 && r < 137, "less red, more blue: {r} {g} {b}");
    // The file asks, and flags win.
    std::fs::write(
        folder.path("scene.toml"),
        SCENE.replace("spp = 1\n", "spp = 1\nexposure = 1\nresponse = \"linear\"\n"),
    )
    .expect("written");
    assert_eq!(render(&[]), [128, 64, 32]);
    assert_eq!(render(&["--response", "srgb", "--exposure", "0"]), [137, 99, 71]);
    for bad in [["--exposure", "bright"], ["--response", "film"], ["--white-balance", "400"]] {
        assert_eq!(folder.render(&[&["-o", "a.png"], &bad[..]].concat()).status.code(), Some(2), "{bad:?}");
    }
}

#[test]
fn parts_know_where_they_belong() {
    let folder = Folder::new(SCENE);
    let (whole, part) = (folder.path("whole.exr"), folder.path("part.exr"));
    assert!(folder.render(&["-q", "-o", &whole]).status.success());
    let output = folder.render(&["-q", "-o", &part, "--crop", "10,5,17x20"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let (whole, cut) = (folder.image("whole.exr"), folder.image("part.exr"));
    assert_eq!((cut.width, cut.height), (17, 20));
    for (i, pixel) in cut.pixels.iter().enumerate() {
        assert_eq!(*pixel, whole.pixels[(5 + i / 17) * 40 + 10 + i % 17]);
    }
    let window = twincast::image::read_metadata(part.as_ref()).expect("metadata").window;
    assert_eq!(window, Some(twincast::image::Window { x: 10, y: 5, full: [40, 30] }));
    let again = folder.render(&["-q", "-o", &folder.path("b.exr"), "--crop", "10,5,17x20", "--reference", &part]);
    assert!(again.status.success(), "{}", text(&again.stderr));
    for bad in ["30,0,11x1", "0,0,0x1", "1,2", "1,2,3", "-1,0,2x2"] {
        let output = folder.render(&["-o", &folder.path("c.exr"), &format!("--crop={bad}")]);
        assert_eq!(output.status.code(), Some(2), "{bad}: {}", text(&output.stderr));
    }
}

#[test]
fn a_pixel_is_told_as_numbers_text_or_json() {
    let folder = Folder::new(SCENE);
    let output = folder.render(&["--pixel", "20,15"]);
    assert_eq!(text(&output.stdout), "0.25 0.125 0.0625 1\n", "{}", text(&output.stderr));
    let told = text(&folder.render(&["--pixel", "20,15", "--explain"]).stdout);
    for words in [
        "pixel 20,15: 0.25 0.125 0.0625, coverage 1",
        "ray 0 from 0,5,0",
        "enters 1 nodes",
        "by itself 0.25,0.125,0.0625",
        "\"glow\"",
    ] {
        assert!(told.contains(words), "{words} in {told}");
    }
    let output = folder.render(&["--pixel", "0,0", "--explain", "--json"]);
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one document");
    assert_eq!(document["value"], serde_json::json!([0.0, 0.0, 0.0, 0.0]));
    assert!(document["samples"][0]["rays"][0]["hit"].is_null(), "{document}");
    assert_eq!(document["samples"][0]["rays"][0]["steps"]["shapes"], 0);
    for bad in [&["--pixel", "40,0"][..], &["--pixel", "1"], &["--explain"], &["--pixel", "1,1", "-o", "a.png"]] {
        assert_eq!(folder.render(bad).status.code(), Some(2), "{bad:?}");
    }
    assert_eq!(std::fs::read_dir(folder.0.path()).unwrap().count(), 1, "no file is written");
}

/// Reads packets as tev does.
struct Packets<'a>(&'a [u8]);

impl<'a> Packets<'a> {
    fn take(&mut self, count: usize) -> &'a [u8] {
        let (head, rest) = self.0.split_at(count);
        self.0 = rest;
        head
    }

    fn byte(&mut self) -> u8 {
        self.take(1)[0]
    }

    fn number(&mut self) -> u32 {
        u32::from_le_bytes(self.take(4).try_into().expect("four"))
    }

    fn long(&mut self) -> usize {
        u64::from_le_bytes(self.take(8).try_into().expect("eight")) as usize
    }

    fn text(&mut self) -> String {
        let length = self.0.iter().position(|&byte| byte == 0).expect("it ends");
        let text = text(self.take(length));
        self.take(1);
        text
    }
}

#[test]
fn tev_is_shown_the_picture() {
    let folder = Folder::new(&SCENE.replace("[40, 30]", "[70, 50]"));
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("its address").to_string();
    let heard = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        listener.accept().expect("somebody calls").0.read_to_end(&mut bytes).expect("until they hang up");
        bytes
    });
    let exr = folder.path("a.exr");
    let output = folder.render(&["-q", "-o", &exr, "--display-server", &address]);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    let bytes = heard.join().expect("it listened");

    let (mut packets, mut shown, mut updates) = (Packets(&bytes), None, 0);
    while !packets.0.is_empty() {
        let length = packets.number() as usize;
        let mut packet = Packets(packets.take(length - 4));
        let (kind, _focus, name) = (packet.byte(), packet.byte(), packet.text());
        assert_eq!(name, "scene.toml by native (BVH)");
        if kind == 4 {
            let (width, height, channels) = (packet.number(), packet.number(), packet.number());
            let names: Vec<_> = (0..channels).map(|_| packet.text()).collect();
            assert_eq!(names, ["R", "G", "B", "A"]);
            shown = Some(Image::new(width, height));
        } else {
            assert_eq!(kind, 6);
            let image = shown.as_mut().expect("created before it is updated");
            let channels = packet.number() as usize;
            (0..channels).for_each(|_| assert_eq!(packet.text().len(), 1));
            let [x, y, width, height] = [0; 4].map(|_| packet.number());
            let offsets: Vec<_> = (0..channels).map(|_| packet.long()).collect();
            let strides: Vec<_> = (0..channels).map(|_| packet.long()).collect();
            let floats: Vec<f32> =
                packet.0.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four"))).collect();
            assert_eq!(floats.len(), (width * height * 4) as usize);
            for pixel in 0..(width * height) as usize {
                let at = (y as usize + pixel / width as usize) * 70 + x as usize + pixel % width as usize;
                image.pixels[at] = Vec4::from_array([0, 1, 2, 3].map(|c| floats[offsets[c] + pixel * strides[c]]));
            }
            packet.0 = &[];
            updates += 1;
        }
        assert!(packet.0.is_empty(), "nothing is left over");
    }
    assert_eq!(updates, 6, "one a tile");
    assert_eq!(shown.expect("an image"), folder.image("a.exr"));
}

#[test]
fn a_viewer_that_is_not_there_is_told_before_the_work() {
    let folder = Folder::new(SCENE);
    let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("its address").port();
    let output = folder.render(&["-o", &folder.path("a.exr"), "--display-server", &format!("127.0.0.1:{port}")]);
    let message = text(&output.stderr);
    assert_eq!((output.status.code(), message.lines().count()), (Some(3), 1), "{message}");
    assert!(message.contains(&format!("127.0.0.1:{port}")) && message.contains("start tev"), "{message}");
    assert!(!std::fs::exists(folder.path("a.exr")).unwrap());
    assert_eq!(folder.render(&["-o", "a.exr", "--display-server", "localhost"]).status.code(), Some(2));
}
