//! Which pixels of two pictures differ, and whether a ray explains it.
//!
//! A pixel that differs is traced again, native leading: if the engines part on one of its rays, on the camera ray or
//! on one that follows from it, that ray's class is the explanation. Embree's answer may depend on the packet that a
//! ray travels in, so each ray is asked in every width. What then still looks the same was rendered in yet another
//! packet: a ray that native's own hit shows to be a boundary ray explains that as well, and nothing else does.

use std::sync::Mutex;

use rayon::prelude::*;

use super::classify::{Answers, Class, classify_closest, classify_occluded, is_boundary};
use crate::image::Image;
use crate::math::Vec4;
use crate::ray::{Hit, Ray};
use crate::render::Renderer;
use crate::trace::{Batch, Tracer, Width, World};

/// How two pictures differ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelReport {
    /// Pixels in each picture.
    pub pixels: u64,
    /// Those that are not equal to the bit.
    pub differing: u64,
    /// Those that differ and have no ray that explains it.
    pub unexplained: u64,
    /// Those that differ and have a tie or a boundary ray.
    pub tie_or_boundary: u64,
    /// Those that differ, have neither, and have a ray on which Embree is wrong.
    pub embree_wrong: u64,
    /// The largest difference of a channel; infinite where one picture has NaN and the other has not.
    pub max_abs: f32,
    /// The first unexplained pixel, row by row.
    pub first_unexplained: Option<(u32, u32)>,
}

/// Compares the pictures that `renderer` made on each engine, and explains the pixels that differ.
///
/// # Panics
/// Where the pictures are not of one size.
pub fn explain_pixels<A: Tracer, B: Tracer>(
    renderer: &Renderer<'_>,
    native: &A,
    embree: &B,
    native_image: &Image,
    embree_image: &Image,
) -> PixelReport {
    explain_with(native_image, embree_image, |x, y| {
        let witness = Witness { world: renderer.world(), native, embree, seen: Mutex::default() };
        let window = renderer.window();
        renderer.pixel(&witness, window.x + x, window.y + y);
        witness.verdict()
    })
}

/// The same, with a function that gives the classes of a pixel's rays.
fn explain_with(a: &Image, b: &Image, classes: impl Fn(u32, u32) -> Seen + Sync) -> PixelReport {
    assert_eq!((a.width, a.height), (b.width, b.height), "pictures of one size");
    let width = a.width.max(1) as usize;
    let bits = |p: &Vec4| p.to_array().map(f32::to_bits);
    let differing: Vec<(u32, u32, f32, Seen)> = (a.pixels.par_iter().zip(&b.pixels).enumerate())
        .filter(|(_, (p, q))| bits(p) != bits(q))
        .map(|(i, (p, q))| {
            let (x, y) = ((i % width) as u32, (i / width) as u32);
            (x, y, distance(*p, *q), classes(x, y))
        })
        .collect();
    let mut report =
        PixelReport { pixels: a.pixels.len() as u64, differing: differing.len() as u64, ..PixelReport::default() };
    for (x, y, distance, seen) in differing {
        report.max_abs = report.max_abs.max(distance);
        if seen.tie_or_boundary {
            report.tie_or_boundary += 1;
        } else if seen.embree_wrong {
            report.embree_wrong += 1;
        } else {
            report.unexplained += 1;
            report.first_unexplained.get_or_insert((x, y));
        }
    }
    report
}

/// The largest difference of a channel.
fn distance(a: Vec4, b: Vec4) -> f32 {
    let differences = (a - b).abs().to_array();
    let equal = |i: usize| a[i] == b[i] || (a[i].is_nan() && b[i].is_nan());
    (0..4)
        .filter(|&i| !equal(i))
        .map(|i| differences[i])
        .fold(0.0, |largest, d| if d.is_nan() { f32::INFINITY } else { d.max(largest) })
}

/// What a pixel's rays were judged to be.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    tie_or_boundary: bool,
    embree_wrong: bool,
}

impl Seen {
    fn note(&mut self, class: Class) {
        match class {
            Class::Tie | Class::Boundary => self.tie_or_boundary = true,
            Class::EmbreeWrong => self.embree_wrong = true,
            Class::Agree | Class::NativeWrong => {}
        }
    }
}

/// Answers as native does, and notes where Embree, in any packet, would not.
struct Witness<'a, A, B> {
    world: &'a World,
    native: &'a A,
    embree: &'a B,
    seen: Mutex<Seen>,
}

impl<A: Tracer, B: Tracer> Witness<'_, A, B> {
    fn verdict(self) -> Seen {
        self.seen.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn note(&self, class: Class) {
        self.seen.lock().unwrap_or_else(std::sync::PoisonError::into_inner).note(class);
    }

    fn note_boundary(&self, ray: &Ray, hit: Option<Hit>) {
        if hit.is_some_and(|hit| is_boundary(self.world, ray, &hit)) {
            self.note(Class::Boundary);
        }
    }
}

/// Every kind of packet.
fn packets() -> impl Iterator<Item = Batch> {
    let widths = Width::ALL.into_iter();
    widths.flat_map(|width| [false, true].map(|coherent| Batch { width, coherent }))
}

impl<A: Tracer, B: Tracer> Tracer for Witness<'_, A, B> {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let native = self.native.closest(ray);
        self.note_boundary(ray, native);
        for batch in packets() {
            let mut hits = [None; 16];
            let n = batch.width.rays();
            self.embree.closest_batch(&[*ray; 16][..n], &mut hits[..n], batch);
            self.note(classify_closest(self.world, ray, &Answers { native, embree: hits[0], brute: None }));
        }
        native
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let native = self.native.occluded(ray);
        if native {
            self.note_boundary(ray, self.native.closest(ray));
        }
        for batch in packets() {
            let mut answers = [false; 16];
            let n = batch.width.rays();
            self.embree.occluded_batch(&[*ray; 16][..n], &mut answers[..n], batch);
            let closest =
                || Answers { native: self.native.closest(ray), embree: self.embree.closest(ray), brute: None };
            self.note(classify_occluded(self.world, ray, native, answers[0], None, closest));
        }
        native
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: [f32; 4]) -> Image {
        Image { width: 2, height: 2, pixels: pixels.map(Vec4::splat).to_vec() }
    }

    #[test]
    fn pixels_are_counted_once_by_the_mildest_explanation() {
        let (a, b) = (image([0.0, 1.0, 2.0, 3.0]), image([0.5, 1.0, 2.25, 3.125]));
        let report = explain_with(&a, &b, |x, y| match (x, y) {
            (0, 0) => Seen { tie_or_boundary: true, embree_wrong: true },
            (0, 1) => Seen { tie_or_boundary: false, embree_wrong: true },
            _ => Seen::default(),
        });
        let expected = PixelReport {
            pixels: 4,
            differing: 3,
            unexplained: 1,
            tie_or_boundary: 1,
            embree_wrong: 1,
            max_abs: 0.5,
            first_unexplained: Some((1, 1)),
        };
        assert_eq!(report, expected);
    }

    #[test]
    fn nan_in_both_is_no_difference_and_in_one_is_infinite() {
        let (a, b) = (image([f32::NAN, 0.0, 0.0, 0.0]), image([f32::NAN, 0.0, 0.0, f32::NAN]));
        let report = explain_with(&a, &b, |_, _| Seen::default());
        assert_eq!((report.differing, report.max_abs), (1, f32::INFINITY));
    }
}
