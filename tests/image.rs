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

/// What a PNG says of its codes is what they are (PNG, third edition, sections 11.3.2.2 and 11.3.2.5): no sRGB where they are the light itself.
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
