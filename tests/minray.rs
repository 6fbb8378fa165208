//! Heckbert's business card ray tracer: his picture, from his scene as a file.

use twincast::io::{LoadOptions, load};
use twincast::trace::bvh::Bvh;
use twincast::{Renderer, Settings, World};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/minray");

/// The numbers of a plain PPM, after its size and its largest value.
fn reference() -> Vec<i32> {
    let text = std::fs::read_to_string(format!("{FOLDER}/heckbert.ppm")).expect("the program's own picture");
    let numbers =
        text.strip_prefix("P3").expect("a plain PPM").split_whitespace().map(|word| word.parse().expect("a number"));
    let numbers: Vec<i32> = numbers.collect();
    assert_eq!(numbers[..3], [32, 32, 255]);
    numbers[3..].to_vec()
}

#[test]
fn every_channel_is_within_one_of_the_original() {
    let (scene, warnings) = load(format!("{FOLDER}/minray.toml").as_ref(), &LoadOptions::default()).unwrap();
    assert_eq!(warnings, []);
    let world = World::new(&scene).unwrap();
    let request = &scene.request;
    let [width, height] = request.size.unwrap();
    let (spp, max_depth) = (request.spp.unwrap(), request.max_depth);
    let settings = Settings { width, height, spp, max_depth, ..Settings::default() };
    let renderer = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings).unwrap();
    let image = renderer.render(&Bvh::build(&world), Default::default()).unwrap();
    // The program truncates 255 times the radiance.
    let channels = image.pixels.iter().flat_map(|pixel| pixel.truncate().to_array());
    let channels: Vec<i32> = channels.map(|x| (255.0 * x) as i32).collect();
    let reference = reference();
    assert_eq!(channels.len(), reference.len());
    let far: Vec<_> = (0..channels.len()).filter(|&i| (channels[i] - reference[i]).abs() > 1).collect();
    let first: Vec<_> = far.iter().take(8).map(|&i| (i / 3 % 32, i / 96, i % 3, channels[i], reference[i])).collect();
    assert!(far.is_empty(), "{} of {} channels, the first: {first:?}", far.len(), channels.len());
}
