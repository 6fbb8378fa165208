//! Image files, whichever backend this build has.

use std::fs;
use std::path::{Path, PathBuf};

use twincast::image::{self, Depth, Image, Metadata, WriteOptions};
use twincast::math::Vec4;

/// Values that binary16 holds exactly.
fn exact_in_half() -> Image {
    let (width, height) = (131, 67);
    let mut image = Image::new(width, height);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        let n = i as f32;
        *pixel = Vec4::new((n % 2048.0) / 1024.0, -(n % 64.0), (n % 1000.0) * 32.0, (n % 5.0) / 4.0);
    }
    image
}

/// Values that only binary32 holds.
fn exact_in_float() -> Image {
    let mut image = exact_in_half();
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        *pixel += Vec4::new(0.1, 1e-9, 1e9, 0.0) * i as f32;
    }
    image
}

fn write(path: &Path, image: &Image, depth: Depth) {
    image::write(path, image, &Metadata::default(), &WriteOptions { depth, ..Default::default() }).unwrap();
}

fn names(folder: &Path) -> Vec<String> {
    fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn exr_keeps_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    write(&path, &exact_in_half(), Depth::Half);
    assert_eq!(image::read(&path).unwrap(), exact_in_half());
    let half_size = fs::metadata(&path).unwrap().len();
    write(&path, &exact_in_float(), Depth::Float);
    assert_eq!(image::read(&path).unwrap(), exact_in_float());
    assert!(fs::metadata(&path).unwrap().len() > half_size);
    assert_eq!(names(folder.path()), ["a.exr"]);
}

#[test]
fn half_is_the_default() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let mut picture = exact_in_float();
    picture.pixels.iter_mut().for_each(|pixel| *pixel = pixel.min(Vec4::splat(65504.0)));
    image::write(&path, &picture, &Metadata::default(), &WriteOptions::default()).unwrap();
    let back = image::read(&path).unwrap();
    // 0.1 + 1/1024 lies between 2^-4 and 2^-3, where binary16 has steps of 2^-14: it is 1654.4 of them.
    assert_eq!(back.pixels[1].x, 1654.0 / 16384.0);
}

/// The bytes are read by the crate image, not by this library's reader.
#[test]
fn png_holds_srgb() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    // Linear values of codes 0, 1, 55, 128, 188 and 255, with 17 digits from the standard's formula.
    let table = [
        (0.0, 0u8),
        (0.000_303_527, 1),
        (0.038_204_372, 55),
        (0.215_860_5, 128),
        (0.502_886_5, 188),
        (1.0, 255),
        (12.0, 255),
        (-3.0, 0),
        (f32::NAN, 0),
    ];
    let mut image = Image::new(table.len() as u32, 2);
    for (i, &(linear, _)) in table.iter().enumerate() {
        image.pixels[i] = Vec4::new(linear, linear, linear, 1.0);
        image.pixels[table.len() + i] = Vec4::new(linear, 0.0, 1.0, 1.0) * Vec4::new(0.25, 0.25, 0.25, 0.25);
    }
    write(&path, &image, Depth::Half);
    let decoded = ::image::open(&path).unwrap().into_rgba8();
    for (i, &(linear, code)) in table.iter().enumerate() {
        assert_eq!(decoded.get_pixel(i as u32, 0).0, [code, code, code, 255], "{linear}");
        assert_eq!(decoded.get_pixel(i as u32, 1).0, [code, 0, 255, 64], "{linear}");
    }
    let back = image::read(&path).unwrap();
    assert_eq!(back.pixels[3], Vec4::new(0.215_860_5, 0.215_860_5, 0.215_860_5, 1.0));
    // Straight in the file, premultiplied in memory.
    let quarter = 64.0 / 255.0;
    assert_eq!(back.pixels[table.len() + 5], Vec4::new(quarter, 0.0, quarter, quarter));
}

/// Codes go through the response, floating values do not.
#[test]
fn only_codes_are_developed() {
    use twincast::image::{Curve, Response};
    let folder = tempfile::tempdir().unwrap();
    let response = Response { exposure: 1.0, curve: Curve::Linear, ..Response::default() };
    let options = WriteOptions { depth: Depth::Float, response, ..Default::default() };
    let mut image = Image::new(1, 1);
    image.pixels[0] = Vec4::new(0.1, 0.05, 0.2, 0.5);
    let [png, exr, jpg] = ["a.png", "a.exr", "a.jpg"].map(|name| folder.path().join(name));
    for path in [&png, &exr, &jpg] {
        image::write(path, &image, &Metadata::default(), &options).unwrap();
    }
    assert_eq!(image::read(&exr).unwrap(), image);
    // Straight and twice as bright: 0.4, 0.2, 0.8 of 255. Over black where there is no alpha.
    assert_eq!(::image::open(&png).unwrap().into_rgba8().get_pixel(0, 0).0, [102, 51, 204, 128]);
    let over_black = ::image::open(&jpg).unwrap().into_rgb8().get_pixel(0, 0).0;
    assert!(over_black.iter().zip([51, 26, 102]).all(|(&a, b): (&u8, u8)| a.abs_diff(b) <= 3), "{over_black:?}");
}

/// What a PNG says of its codes is what they are (PNG, third edition, sections 11.3.2.2 and 11.3.2.5): no sRGB where
/// they are the light itself.
#[cfg(feature = "oiio")]
#[test]
fn codes_without_a_transfer_function_are_not_called_srgb() {
    use twincast::image::{Curve, Response};
    let folder = tempfile::tempdir().unwrap();
    for curve in Curve::ALL {
        let path = folder.path().join("a.png");
        let options = WriteOptions { response: Response { curve, ..Response::default() }, ..Default::default() };
        image::write(&path, &Image::new(2, 2), &Metadata::default(), &options).unwrap();
        let bytes = fs::read(&path).unwrap();
        let find = |name: &[u8]| bytes.windows(4).position(|at| at == name);
        let gamma = find(b"gAMA").map(|at| u32::from_be_bytes(*bytes[at + 4..].first_chunk().unwrap()));
        assert_eq!(find(b"sRGB").is_some(), curve != Curve::Linear, "{curve}");
        assert!(gamma.is_none_or(|gamma| (gamma == 100_000) == (curve == Curve::Linear)), "{curve}: {gamma:?}");
    }
}

#[test]
fn metadata_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let metadata = Metadata {
        world_to_camera: Some(std::array::from_fn(|i| i as f64)),
        world_to_screen: Some(std::array::from_fn(|i| 0.5 - i as f64)),
        fovcot: Some(1.75),
        samples_per_pixel: Some(16),
        render_time_seconds: Some(2.25),
        window: Some(image::Window { x: 7, y: 0, full: [64, 32] }),
        ..Default::default()
    };
    assert!(metadata.software.starts_with("twincast "));
    image::write(&path, &Image::new(5, 3), &metadata, &WriteOptions::default()).unwrap();
    assert_eq!(image::read_metadata(&path).unwrap(), metadata);
    // The names that other tools look for, in the file's header.
    let bytes = fs::read(&path).unwrap();
    for name in ["Software", "worldToCamera", "worldToScreen", "fovcot", "samplesPerPixel", "renderTimeSeconds"] {
        let with_end: Vec<u8> = name.bytes().chain([0]).collect();
        assert!(bytes.windows(with_end.len()).any(|w| w == with_end), "{name}");
    }
    // What is not known is not written.
    image::write(&path, &Image::new(5, 3), &Metadata::default(), &WriteOptions::default()).unwrap();
    assert_eq!(image::read_metadata(&path).unwrap(), Metadata::default());
}

#[test]
fn a_failing_write_leaves_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    for (name, width) in [("a.jpg", 70_000), ("a.png", 2_000_000)] {
        let path = folder.path().join(name);
        write(&path, &Image::new(8, 8), Depth::Half);
        let before = fs::read(&path).unwrap();
        let result = image::write(&path, &Image::new(width, 1), &Metadata::default(), &WriteOptions::default());
        if let Err(error) = result {
            assert_eq!(error.exit_code(), 4);
            let text = error.to_string();
            assert!(text.contains(name) && !text.contains(".part.") && !text.contains('\n'), "{text}");
            assert_eq!(fs::read(&path).unwrap(), before);
        } else {
            assert_ne!(name, "a.jpg", "JPEG has no such sizes");
            assert_eq!(image::read(&path).unwrap().width, width);
        }
    }
    let mut left = names(folder.path());
    left.sort();
    assert_eq!(left, ["a.jpg", "a.png"]);
}

#[test]
fn impossible_outputs() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("folder.exr")).unwrap();
    for (path, words) in [
        (at("a.xyz"), "unknown suffix .xyz; this build writes "),
        // OpenImageIO would write colours into it.
        (at("a.pgm"), "unknown suffix .pgm; this build writes "),
        (at("a"), "no suffix; this build writes "),
        (at("missing/a.exr"), "does not exist"),
        (at("folder.exr"), "is a folder"),
    ] {
        for error in [
            image::check_writable(&path).unwrap_err(),
            image::write(&path, &Image::new(1, 1), &Metadata::default(), &WriteOptions::default()).unwrap_err(),
        ] {
            assert!(error.to_string().contains(words), "{error}");
            assert_eq!(error.exit_code(), 4);
        }
    }
    let listed = image::check_writable(&at("a.xyz")).unwrap_err().to_string();
    for suffix in ["exr", "png", "jpg"] {
        assert!(listed.contains(suffix), "{listed}");
        image::check_writable(&at("a").with_extension(suffix)).unwrap();
        image::check_writable(&at("a").with_extension(suffix.to_uppercase())).unwrap();
    }
    assert_eq!(names(folder.path()), ["folder.exr"]);
    let torn = Image { width: 2, height: 2, pixels: vec![Vec4::ONE; 3] };
    for image in [torn, Image::new(0, 4)] {
        let result = image::write(&at("a.png"), &image, &Metadata::default(), &WriteOptions::default());
        assert_eq!(result.unwrap_err().exit_code(), 2);
    }
}

/// A PNG's signature, an IHDR chunk of this size with a correct checksum, and nothing that follows.
fn png_header(width: u32, height: u32) -> Vec<u8> {
    let mut chunk = b"IHDR".to_vec();
    chunk.extend(width.to_be_bytes());
    chunk.extend(height.to_be_bytes());
    chunk.extend([8, 6, 0, 0, 0]);
    let mut crc = u32::MAX;
    for &byte in &chunk {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    let mut file = b"\x89PNG\r\n\x1a\n\0\0\0\x0d".to_vec();
    file.extend(chunk);
    file.extend((!crc).to_be_bytes());
    file.extend(b"\0\0\0\x04IDAT\0\0\0\0\0\0\0\0");
    file
}

/// A small file, with both windows in its header changed to this size.
fn exr_that_claims(path: &Path, width: i32, height: i32) {
    write(path, &Image::new(8, 8), Depth::Half);
    let mut bytes = fs::read(path).unwrap();
    for name in [b"dataWindow\0box2i\0".as_slice(), b"displayWindow\0box2i\0"] {
        let start = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
        bytes[start + 8..start + 12].copy_from_slice(&(width - 1).to_le_bytes());
        bytes[start + 12..start + 16].copy_from_slice(&(height - 1).to_le_bytes());
    }
    fs::write(path, bytes).unwrap();
}

#[test]
fn false_claims_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (png, exr) = (folder.path().join("a.png"), folder.path().join("a.exr"));
    for size in [100_000, 16_000] {
        fs::write(&png, png_header(size, size)).unwrap();
        exr_that_claims(&exr, size as i32, size as i32);
        for path in [&png, &exr] {
            let error = image::read(path).unwrap_err();
            assert_eq!(error.exit_code(), 3);
            let text = error.to_string();
            assert!(text.contains(&path.display().to_string()) && !text.contains('\n'), "{text}");
            // A library may have refused it before, in its own words.
            assert!(text.contains(&format!("claims {size} x {size}")) || path == &exr, "{text}");
        }
    }
}

#[test]
fn broken_inputs_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let good = |name: &str| -> PathBuf {
        let path = folder.path().join(name);
        write(&path, &exact_in_half(), Depth::Half);
        path
    };
    for name in ["a.png", "a.exr", "a.jpg"] {
        let path = good(name);
        let bytes = fs::read(&path).unwrap();
        for keep in [0, 1, 4, 20, 100, bytes.len() / 2] {
            fs::write(&path, &bytes[..keep]).unwrap();
            let error = image::read(&path).expect_err("a truncated file");
            assert_eq!(error.exit_code(), 3, "{name} {keep}");
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
    for path in [folder.path().to_owned(), folder.path().join("missing.png")] {
        assert_eq!(image::read(&path).unwrap_err().exit_code(), 3);
    }
    let text = folder.path().join("text.png");
    fs::write(&text, "not an image").unwrap();
    assert!(image::read(&text).unwrap_err().to_string().starts_with(&text.display().to_string()));
}

/// The parts of an error that say which file it is about, that it is an input, and these words.
#[track_caller]
fn refused(path: &Path, words: &[&str]) {
    let error = image::read(path).expect_err("a picture that is not read");
    let text = error.to_string();
    assert_eq!(error.exit_code(), 3, "{text}");
    assert!(text.starts_with(&path.display().to_string()) && !text.contains('\n'), "{text}");
    assert!(words.iter().all(|words| text.contains(words)), "{words:?} in {text}");
}

/// Readers that write past their memory where a file is damaged get to see none, whatever it is called.
#[cfg(feature = "oiio")]
#[test]
fn formats_whose_readers_are_not_trusted_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    // How such files begin.
    let starts: [(&str, &[u8]); 4] = [
        ("iff", b"FOR4\0\0\0\x80CIMGTBHD\0\0\0\x20"),
        ("ico", b"\0\0\x01\0\x01\0\x08\x08\0\0\x01\0\x20\0"),
        ("z", b"\x2f\x08\x67\xab\0\x04\0\x04"),
        ("sgi", b"\x01\xda\x01\x01\0\x03\0\x04\0\x04\0\x03"),
    ];
    for (suffix, start) in starts {
        let bytes = [start, &[0; 200]].concat();
        let path = folder.path().join("a").with_extension(suffix);
        fs::write(&path, &bytes).unwrap();
        refused(
            &path,
            &[&format!("pictures of the format .{suffix} are not read; convert it to EXR, HDR, PNG, JPEG or TIFF")],
        );
        let misnamed = folder.path().join("a.exr");
        fs::write(&misnamed, &bytes).unwrap();
        refused(&misnamed, &["no .exr picture, nor another of a format that is read; convert it"]);
    }
    // What is written still is.
    let path = folder.path().join("b.sgi");
    write(&path, &Image::new(8, 8), Depth::Half);
    refused(&path, &["pictures of the format .sgi are not read"]);
}

/// The suffix may lie.
#[test]
fn formats_are_told_by_the_content() {
    let folder = tempfile::tempdir().unwrap();
    let [png, lie] = ["a.png", "a.exr"].map(|name| folder.path().join(name));
    write(&png, &exact_in_half(), Depth::Half);
    fs::rename(&png, &lie).unwrap();
    assert_eq!(image::read(&lie).unwrap().width, exact_in_half().width);
}

/// An OpenEXR file of two pixels with these channels, in each of which they are `value` and half of that.
fn exr_of(path: &Path, channels: &[(&str, f32)]) {
    use exr::prelude::*;
    let list = channels.iter().map(|&(name, value)| {
        let samples = match name.strip_prefix("uint ") {
            Some(_) => FlatSamples::U32(vec![value as u32; 2]),
            None => FlatSamples::F32(vec![value, value / 2.0]),
        };
        AnyChannel::new(name.trim_start_matches("uint "), samples)
    });
    let channels = AnyChannels::sort(list.collect());
    let layer = Layer::new((2, 1), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels);
    exr::prelude::Image::from_layer(layer).write().to_file(path).unwrap();
}

/// Colours are the channels that are called so, wherever they stand and whatever stands before them.
#[test]
fn colours_of_openexr_are_told_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for (channels, pixel) in [
        (&[("Adepth.Z", 9.0), ("B", 3.0), ("G", 2.0), ("R", 1.0)][..], [1.0, 2.0, 3.0, 1.0]),
        (&[("A", 0.5), ("Adepth.Z", 9.0), ("B", 3.0), ("G", 2.0), ("R", 1.0), ("Z", 7.0)], [1.0, 2.0, 3.0, 0.5]),
        (&[("B", 3.0), ("C", 9.0), ("G", 2.0), ("R", 1.0), ("Y", 8.0)], [1.0, 2.0, 3.0, 1.0]),
        (&[("Adepth.Z", 9.0), ("B", 3.0), ("R", 1.0), ("Y", 4.0)], [4.0, 4.0, 4.0, 1.0]),
        (&[("A", 0.5), ("Y", 4.0)], [4.0, 4.0, 4.0, 0.5]),
        (&[("depth", 4.0)], [4.0, 4.0, 4.0, 1.0]),
    ] {
        exr_of(&path, channels);
        let image = image::read(&path).unwrap();
        assert_eq!(image.pixels[0].to_array(), pixel, "{channels:?}");
        assert_eq!(image.pixels[1].x, pixel[0] / 2.0, "{channels:?}");
    }
    for channels in [
        &[("B", 3.0), ("R", 1.0)][..],
        &[("X", 1.0), ("Z", 3.0)],
        &[("Adepth.Z", 1.0), ("beauty.B", 3.0), ("beauty.G", 2.0), ("beauty.R", 1.0)],
    ] {
        exr_of(&path, channels);
        let names: Vec<_> = channels.iter().map(|(name, _)| *name).collect();
        refused(&path, &["no channels R, G and B, or Y; it has "]);
        let text = image::read(&path).unwrap_err().to_string();
        assert!(names.iter().all(|name| text.contains(name)), "{text}");
    }
    exr_of(&path, &[("uint B", 3.0), ("uint G", 2.0), ("uint R", 1.0)]);
    refused(&path, &["whole numbers"]);
    // Beside colours they are what they are.
    exr_of(&path, &[("B", 3.0), ("G", 2.0), ("R", 1.0), ("uint object", 7.0)]);
    assert_eq!(image::read(&path).unwrap().pixels[0].to_array(), [1.0, 2.0, 3.0, 1.0]);
}

/// Radiance, *Radiance file formats*: the first axis of the line of sizes is the slower one, +Y upwards, +X to the
/// right.
#[cfg(feature = "oiio")]
#[test]
fn the_line_of_sizes_of_radiance_says_how_a_picture_lies() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.hdr");
    let read = |sizes: &str, reds: [u8; 6]| {
        let mut file = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{sizes}\n").into_bytes();
        reds.iter().for_each(|&red| file.extend([red, 1, 1, 129]));
        fs::write(&path, file).unwrap();
        image::read(&path)
    };
    let upright = read("-Y 2 +X 3", [10, 20, 30, 40, 50, 60]).unwrap();
    assert_eq!((upright.width, upright.height), (3, 2));
    assert!(upright.pixels[0].x < upright.pixels[5].x);
    assert_eq!(read("+Y 2 +X 3", [40, 50, 60, 10, 20, 30]).unwrap(), upright);
    assert_eq!(read("-Y 2 -X 3", [30, 20, 10, 60, 50, 40]).unwrap(), upright);
    assert_eq!(read("+Y 2 -X 3", [60, 50, 40, 30, 20, 10]).unwrap(), upright);
    for sizes in ["+X 3 -Y 2", "-X 3 -Y 2", "+X 3 +Y 2", "-X 3 +Y 2"] {
        assert!(read(sizes, [1; 6]).is_err());
        refused(&path, &["-Y or +Y"]);
    }
}

/// What a camera says of how it was held.
#[test]
fn jpeg_files_are_turned_as_exif_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jpg");
    let mut image = Image::new(32, 16);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        *pixel = Vec4::new(if i % 32 < 16 { 0.9 } else { 0.1 }, if i < 256 { 0.9 } else { 0.1 }, 0.2, 1.0);
    }
    write(&path, &image, Depth::Half);
    let plain = fs::read(&path).unwrap();
    let is_near = |a: f32, b: f32| (a - b).abs() < 0.1;
    // Seen from the upper left corner: whether red, then green, is bright there; and whether width and height change
    // places.
    for (orientation, red, green, turned) in [
        (1u8, true, true, false),
        (2, false, true, false),
        (3, false, false, false),
        (4, true, false, false),
        (5, true, true, true),
        (6, true, false, true),
        (7, false, false, true),
        (8, false, true, true),
    ] {
        let directory = [0, 1, 0x01, 0x12, 0, 3, 0, 0, 0, 1, 0, orientation, 0, 0, 0, 0, 0, 0];
        let exif = [&b"Exif\0\0MM\0*\0\0\0\x08"[..], &directory].concat();
        let segment = [&[0xff, 0xe1, 0, exif.len() as u8 + 2][..], &exif].concat();
        fs::write(&path, [&plain[..2], &segment, &plain[2..]].concat()).unwrap();
        let found = image::read(&path).unwrap();
        assert_eq!([found.width, found.height], if turned { [16, 32] } else { [32, 16] }, "{orientation}");
        let corner = found.pixels[0];
        let value = |bright| if bright { 0.9 } else { 0.1 };
        assert!(is_near(corner.x, value(red)) && is_near(corner.y, value(green)), "{orientation}: {corner}");
    }
}

/// An OpenEXR file of three columns and two rows, whose pixels are 1 to 6, with its origin and the x, y, width and
/// height of the display window.
fn exr_within(path: &Path, at: (i32, i32), (x, y, width, height): (i32, i32, usize, usize)) {
    use exr::prelude::*;
    let pixels = |at: Vec2<usize>| {
        let value = (at.y() * 3 + at.x()) as f32 + 1.0;
        (value, value, value)
    };
    let attributes = LayerAttributes { layer_position: Vec2(at.0, at.1), ..LayerAttributes::default() };
    let layer = Layer::new((3, 2), attributes, Encoding::UNCOMPRESSED, SpecificChannels::rgb(pixels));
    let mut file = exr::prelude::Image::from_layer(layer);
    file.attributes.display_window = exr::meta::attribute::IntegerBounds::new(Vec2(x, y), (width, height));
    file.write().to_file(path).unwrap();
}

/// A part of a picture is stretched over nothing: it stays where it belongs.
#[test]
fn a_part_is_read_in_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let mut part = Image::new(3, 2);
    part.pixels.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = Vec4::splat(i as f32 + 1.0));
    let metadata = Metadata { window: Some(image::Window { x: 1, y: 2, full: [6, 5] }), ..Default::default() };
    image::write(&path, &part, &metadata, &WriteOptions::default()).unwrap();
    assert_eq!(image::read(&path).unwrap(), part);
    let whole = image::read_whole(&path).unwrap();
    let reds: Vec<f32> = whole.pixels.iter().map(|pixel| pixel.w).collect();
    assert_eq!((whole.width, whole.height), (6, 5));
    let mut expected = vec![0.0; 12];
    expected.extend([0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 4.0, 5.0, 6.0, 0.0, 0.0]);
    expected.extend([0.0; 6]);
    assert_eq!(reds, expected);

    // Windows of others begin anywhere, and pictures reach beyond them.
    for (at, display, expected) in [
        ((-1, 0), (0, 0, 2, 2), vec![2.0, 3.0, 5.0, 6.0]),
        ((11, -20), (10, -20, 4, 1), vec![0.0, 1.0, 2.0, 3.0]),
        ((50, 50), (0, 0, 2, 1), vec![0.0, 0.0]),
        ((0, 0), (0, 0, 3, 2), vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        ((7, 7), (7, 7, 3, 2), vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
    ] {
        exr_within(&path, at, display);
        let whole = image::read_whole(&path).unwrap();
        assert_eq!((whole.width as usize, whole.height as usize), (display.2, display.3));
        assert_eq!(whole.pixels.iter().map(|pixel| pixel.x).collect::<Vec<_>>(), expected, "{at:?} {display:?}");
    }
}
