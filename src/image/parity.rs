//! Tests that both backends write and read the same.

use std::path::Path;

use super::file::Encoding;
use super::metadata::Placed;
use super::samples::{Type, decode, encode};
use super::{Channel, Image, Metadata, Response, Window, oiio, pure};
use crate::math::Vec4;

const HALF: Encoding = Encoding { kind: Type::Half, alpha: true, tile: 64, linear: true };
const BYTES: Encoding = Encoding { kind: Type::U8, alpha: true, tile: 0, linear: false };

/// Not a multiple of a tile, every 8-bit code in each channel, alpha in steps, values over 1, and the odd ones.
fn picture() -> Image {
    let (width, height) = (150, 70);
    let mut image = Image::new(width, height);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        let x = i as f32 / (width * height) as f32;
        let alpha = (i % 7) as f32 / 6.0;
        *pixel = Vec4::new(x * alpha, (1.0 - x) * alpha, 3.0 * x * x * alpha, alpha);
    }
    image.pixels[0] = Vec4::new(f32::INFINITY, -1.0, 1e-7, 1.0);
    image.pixels[1] = Vec4::new(65504.0, 70000.0, 6e-8, 0.25);
    image
}

fn metadata() -> Metadata {
    Metadata {
        software: "twincast test".to_owned(),
        world_to_camera: Some(std::array::from_fn(|i| i as f64 * 0.25)),
        world_to_screen: Some(std::array::from_fn(|i| -(i as f64))),
        fovcot: Some(1.5),
        samples_per_pixel: Some(64),
        render_time_seconds: Some(12.5),
        window: Some(Window { x: 3, y: 50, full: [1000, 300] }),
        texts: vec![
            ("a/b".to_owned(), "two words".to_owned()),
            ("a/c".to_owned(), "{}".to_owned()),
            ("a/d".to_owned(), "Tür 相机".to_owned()),
        ],
    }
}

fn write_both(folder: &Path, suffix: &str, encoding: Encoding) -> [std::path::PathBuf; 2] {
    let [a, b] = ["oiio", "pure"].map(|name| folder.join(name).with_extension(suffix));
    let samples = encode(&picture(), encoding.kind, encoding.alpha, &Response::default());
    oiio::write(&a, &samples, &[], encoding, &metadata()).unwrap();
    pure::write(&b, &samples, &[], encoding, &metadata()).unwrap();
    [a, b]
}

#[test]
fn pixels_are_identical() {
    let folder = tempfile::tempdir().unwrap();
    let bits =
        |image: &Image| -> Vec<u32> { image.pixels.iter().flat_map(|p| p.to_array().map(f32::to_bits)).collect() };
    let float = Encoding { kind: Type::Float, alpha: true, tile: 16, linear: true };
    for (suffix, encoding) in [("exr", HALF), ("exr", float), ("png", BYTES)] {
        let files = write_both(folder.path(), suffix, encoding);
        let mut images = Vec::new();
        for file in &files {
            images.push(decode(oiio::read(file, &|_, _| Ok(())).unwrap()));
            images.push(decode(pure::read(file, &|_, _| Ok(())).unwrap()));
        }
        for image in &images[1..] {
            assert_eq!(bits(&images[0]), bits(image), "{suffix} {encoding:?}");
        }
        if encoding.kind == Type::Float {
            assert_eq!(bits(&images[0]), bits(&picture()));
        }
    }
}

#[test]
fn metadata_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    for file in write_both(folder.path(), "exr", HALF) {
        assert_eq!(oiio::read_metadata(&file).unwrap(), metadata());
        assert_eq!(pure::read_metadata(&file).unwrap(), metadata());
    }
}

#[test]
fn files_are_tiled_and_zipped() {
    use exr::meta::BlockDescription;
    let folder = tempfile::tempdir().unwrap();
    for file in write_both(folder.path(), "exr", HALF) {
        let meta = exr::meta::MetaData::read_from_file(&file, true).unwrap();
        let header = &meta.headers[0];
        assert_eq!(header.compression, exr::prelude::Compression::ZIP16);
        let BlockDescription::Tiles(tiles) = header.blocks else { panic!("{file:?} has rows") };
        assert_eq!(tiles.tile_size, exr::prelude::Vec2(64, 64));
        let names: Vec<_> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
        assert_eq!(names, ["A", "B", "G", "R"]);
    }
}

/// Both write channels of all types, and both read what either has written, to the bit; others read its colours.
#[test]
fn channels_are_identical() {
    let folder = tempfile::tempdir().unwrap();
    let pixels = picture().pixels.len() as u32;
    let channels = [
        Channel::uint("primitive", (0..pixels).map(|i| u32::MAX - i).collect()),
        Channel::float("depth.Z", (0..pixels).map(|i| if i == 7 { f32::INFINITY } else { 1.0 / i as f32 }).collect()),
        Channel::float("A light.R", vec![-1.5; pixels as usize]),
        Channel::uint("Tür", vec![1; pixels as usize]),
        Channel::float("相机.Z", vec![0.5; pixels as usize]),
    ];
    for kind in [Type::Half, Type::Float] {
        let encoding = Encoding { kind, ..HALF };
        let samples = encode(&picture(), kind, true, &Response::default());
        let [a, b] = ["oiio.exr", "pure.exr"].map(|name| folder.path().join(name));
        oiio::write(&a, &samples, &channels, encoding, &metadata()).unwrap();
        pure::write(&b, &samples, &channels, encoding, &metadata()).unwrap();
        let colours = decode(pure::read(&b, &|_, _| Ok(())).unwrap());
        for file in [&a, &b] {
            for read in [oiio::read_channels, pure::read_channels] {
                let mut found = read(file, &|_, _| Ok(())).unwrap();
                assert_eq!((found.width, found.height, found.channels.len()), (150, 70, 4 + channels.len()));
                let reds: Vec<u32> = colours.pixels.iter().map(|p| p.x.to_bits()).collect();
                let read: Vec<u32> = found.floats("R").unwrap().iter().map(|x| x.to_bits()).collect();
                assert_eq!(reds, read, "{file:?}");
                found.channels.retain(|channel| channel.name.len() > 1);
                for channel in &channels {
                    let same = found.channels.iter().find(|found| found.name == channel.name).unwrap();
                    assert_eq!(same.plane.bytes(), channel.plane.bytes(), "{file:?} {}", channel.name);
                }
            }
            for read in [oiio::read, pure::read] {
                assert_eq!(decode(read(file, &|_, _| Ok(())).unwrap()), colours, "{file:?}");
            }
            assert_eq!(oiio::read_metadata(file).unwrap(), metadata());
            assert_eq!(pure::read_metadata(file).unwrap(), metadata());
        }
    }
}

/// A chunk of a PNG file: its name and what it holds.
type Chunk<'a> = (&'a [u8; 4], &'a [u8]);

/// A PNG file with these chunks before its rows, which are written as they are.
fn png(path: &Path, [width, height]: [u32; 2], bits: u8, kind: u8, chunks: &[Chunk<'_>], rows: &[u8]) {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut put = |name: &[u8], contents: &[u8]| {
        let named = [name, contents].concat();
        let crc = named.iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 })
        });
        file.extend((contents.len() as u32).to_be_bytes());
        file.extend(named);
        file.extend((!crc).to_be_bytes());
    };
    let size = [width.to_be_bytes(), height.to_be_bytes()].concat();
    put(b"IHDR", &[&size[..], &[bits, kind, 0, 0, 0]].concat());
    chunks.iter().for_each(|(name, contents)| put(&name[..], contents));
    let sums = rows.iter().fold([1u32, 0], |[a, b], &byte| {
        let a = (a + u32::from(byte)) % 65_521;
        [a, (b + a) % 65_521]
    });
    // One block that is stored.
    let length = rows.len() as u16;
    let head = [&[0x78, 1, 1][..], &length.to_le_bytes(), &(!length).to_le_bytes()].concat();
    put(b"IDAT", &[&head[..], rows, &(sums[1] << 16 | sums[0]).to_be_bytes()].concat());
    put(b"IEND", &[]);
    std::fs::write(path, file).unwrap();
}

/// Whichever way it is packed and whatever is said of it, a PNG file is to libpng what it is to us.
#[test]
fn png_files_of_all_kinds_are_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let mut odd = 7u32;
    let mut noise = |count: usize| -> Vec<u8> {
        (0..count)
            .map(|_| {
                odd = odd.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (odd >> 24) as u8
            })
            .collect()
    };
    let palette: Vec<u8> = noise(3 * 256);
    let linear = 100_000u32.to_be_bytes();
    let (gamma, srgb): (Chunk<'_>, Chunk<'_>) = ((b"gAMA", &linear), (b"sRGB", &[0]));
    let cases: [(u8, u8, usize, Vec<Chunk<'_>>); 21] = [
        (1, 0, 1, vec![]),
        (2, 0, 1, vec![]),
        (4, 0, 1, vec![]),
        (8, 0, 1, vec![]),
        (16, 0, 1, vec![]),
        (8, 0, 1, vec![gamma]),
        (8, 2, 3, vec![srgb]),
        (8, 2, 3, vec![gamma]),
        (16, 2, 3, vec![]),
        (16, 2, 3, vec![gamma]),
        (1, 3, 1, vec![(b"PLTE", &palette[..6])]),
        (4, 3, 1, vec![(b"PLTE", &palette[..48])]),
        (8, 3, 1, vec![(b"PLTE", &palette)]),
        (8, 3, 1, vec![(b"PLTE", &palette), (b"tRNS", &palette[..100])]),
        (8, 4, 2, vec![]),
        (16, 4, 2, vec![]),
        (8, 6, 4, vec![]),
        (8, 6, 4, vec![gamma]),
        (16, 6, 4, vec![]),
        (8, 2, 3, vec![(b"tRNS", &[0, 1, 0, 1, 0, 1])]),
        (16, 6, 4, vec![gamma]),
    ];
    for (bits, kind, channels, chunks) in cases {
        let [width, height] = [19, 11];
        let row = (width * channels * usize::from(bits)).div_ceil(8);
        let mut rows = Vec::new();
        for _ in 0..height {
            rows.push(0);
            rows.extend(noise(row));
        }
        if kind == 2 && bits == 8 {
            // The colour that may be clear.
            rows[1..4].fill(1);
        }
        png(&path, [width as u32, height as u32], bits, kind, &chunks, &rows);
        let read = decode(oiio::read(&path, &|_, _| Ok(())).unwrap());
        let libpng = decode(oiio::read_as(&path, "png", &|_, _| Ok(())).unwrap());
        assert!(read == libpng, "{bits} bits of kind {kind}: {:?} {:?}", &read.pixels[..2], &libpng.pixels[..2]);
    }
}

/// Lossy, so not equal: but close to what was written, and laid over black.
#[test]
fn jpeg_is_close() {
    let folder = tempfile::tempdir().unwrap();
    let encoding = Encoding { alpha: false, ..BYTES };
    let written = decode(encode(&picture(), Type::U8, false, &Response::default()));
    for file in write_both(folder.path(), "jpg", encoding) {
        for read in [oiio::read, pure::read] {
            let image = decode(read(&file, &|_, _| Ok(())).unwrap());
            let d = written.difference(&image).unwrap();
            assert!(d.rmse < 0.02, "{file:?}: {d:?}");
        }
    }
}

/// Both say where a part lies.
#[test]
fn parts_lie_in_the_same_place() {
    let folder = tempfile::tempdir().unwrap();
    for file in write_both(folder.path(), "exr", HALF) {
        for placed in [oiio::placed, pure::placed] {
            assert_eq!(placed(&file).unwrap(), Some(Placed { x: 3, y: 50, full: [1000, 300] }));
        }
    }
    for file in write_both(folder.path(), "png", BYTES) {
        assert!([oiio::placed, pure::placed].iter().all(|placed| placed(&file).unwrap().is_none()));
    }
}

/// Every format that the installed OpenImageIO offers takes a picture and gives it back, to its own reader at least.
#[test]
fn every_writable_suffix_works() {
    let folder = tempfile::tempdir().unwrap();
    let mut image = Image::new(32, 32);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        let alpha = if i < 512 { 1.0 } else { 0.5 };
        *pixel = Vec4::new(0.5 * alpha, 0.25 * alpha, 0.75 * alpha, alpha);
    }
    let mut failures = Vec::new();
    for suffix in oiio::writable_suffixes().unwrap() {
        let path = folder.path().join("a").with_extension(&suffix);
        let result = super::write(&path, &image, &Metadata::default(), &Default::default())
            .map_err(|e| e.to_string())
            .and_then(|()| oiio::read_as(&path, &suffix, &|_, _| Ok(())).map(decode));
        match result {
            Ok(back) => {
                match super::read(&path) {
                    Ok(read) => assert_eq!(read, back, "{suffix}"),
                    Err(error) => assert!(error.to_string().contains("are not read; convert it to EXR"), "{error}"),
                }
                let alpha = ["exr", "sxr", "mxr", "png", "tga", "tpic", "tif", "tiff", "tx", "env", "sm", "vsm"]
                    .contains(&suffix.as_str());
                let mut expected = image.clone();
                expected.pixels.iter_mut().filter(|_| !alpha).for_each(|p| p.w = 1.0);
                let d = expected.difference(&back).unwrap();
                // 8-bit codes, and what lossy formats make of the edge in the middle.
                if d.max_abs > 0.05 {
                    failures.push(format!("{suffix}: {d:?} {} {}", back.pixels[0], back.pixels[1023]));
                }
            }
            Err(e) => failures.push(format!("{suffix}: {e}")),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn openimageio_writes_what_we_write_without_it() {
    let more = oiio::writable_suffixes().unwrap();
    for suffix in pure::writable_suffixes().unwrap() {
        assert!(more.contains(&suffix), "{suffix}");
    }
}
