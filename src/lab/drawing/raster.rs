//! The elements as pixels, each of which is covered by the share that an edge leaves of it.
//!
//! Shares are exact for rectangles, and for lines and circles those of a straight edge at the pixel's distance. Colours
//! are mixed as light, so that thin lines keep their weight.

use super::letters::{ADVANCE, BASELINE, strokes};
use super::{Anchor, Drawing, Element, Font};
use crate::image::Image;
use crate::image::srgb::srgb_to_linear;
use crate::math::{DVec2, Vec3, Vec4};

/// Width of a column of a letter's grid and height of a row, in the size of the letters.
const COLUMN: f64 = 0.088;
const ROW: f64 = 0.115;

impl Drawing {
    /// The picture, on white, with so many pixels to a unit.
    pub fn pixels(&self, width: f64, height: f64, scale: f64) -> Image {
        let side = |length: f64| (length * scale).ceil().clamp(1.0, 32_768.0) as u32;
        let mut canvas = Canvas { image: Image::new(side(width), side(height)), scale };
        canvas.image.pixels.fill(Vec4::ONE);
        self.elements.iter().for_each(|element| canvas.draw(element));
        canvas.image
    }
}

struct Canvas {
    image: Image,
    scale: f64,
}

impl Canvas {
    fn draw(&mut self, element: &Element) {
        let point = |(x, y): (f64, f64)| DVec2::new(x, y) * self.scale;
        match element {
            Element::Text { at, anchor, font, turned, text } => self.text(point(*at), *anchor, *font, *turned, text),
            Element::Rectangle { at, size, color } => {
                let (a, b) = (point(*at), point(*at) + point(*size));
                let overlap = |from: f64, to: f64, at: f64| (to.min(at + 0.5) - from.max(at - 0.5)).clamp(0.0, 1.0);
                let share = |p: DVec2| overlap(a.x, b.x, p.x) * overlap(a.y, b.y, p.y);
                self.cover(a, b, parsed(color), share);
            }
            Element::Line { from, to, color, width } => {
                let width = width * self.scale;
                self.line(point(*from), point(*to), parsed(color), width);
            }
            Element::Circle { at, radius, fill, rim } => {
                let (at, radius) = (point(*at), radius * self.scale);
                let disk = |radius: f64| move |p: DVec2| edge(radius - (p - at).length());
                let outer = radius + 0.5 * self.scale;
                self.cover(at - outer, at + outer, parsed(rim), disk(outer));
                self.cover(at - radius, at + radius, parsed(fill), disk(radius - 0.5 * self.scale));
            }
        }
    }

    fn line(&mut self, a: DVec2, b: DVec2, color: Vec3, width: f64) {
        let along = b - a;
        let distance = |p: DVec2| {
            let t = ((p - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
            (p - a - along * t).length()
        };
        let reach = width / 2.0;
        self.cover(a.min(b) - reach, a.max(b) + reach, color, |p| edge(reach - distance(p)));
    }

    fn text(&mut self, at: DVec2, anchor: Anchor, font: Font, turned: bool, text: &str) {
        let size = font.size * self.scale;
        let (column, row) = (size * COLUMN, size * ROW);
        let length = (text.chars().count() as f64 * ADVANCE - 2.0).max(0.0) * column;
        let start = match anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -length / 2.0,
            Anchor::End => -length,
        };
        let width = size * if font.bold { 0.14 } else { 0.085 };
        let place = |x: f64, y: f64| at + if turned { DVec2::new(y, -x) } else { DVec2::new(x, y) };
        for (letter, i) in text.chars().zip(0u32..) {
            let x = start + f64::from(i) * ADVANCE * column;
            for stroke in strokes(letter) {
                let points: Vec<DVec2> =
                    stroke.iter().map(|(c, r)| place(x + c * column, (r - BASELINE) * row)).collect();
                for ends in points.windows(2) {
                    self.line(ends[0], ends[1], parsed(font.color), width);
                }
            }
        }
    }

    /// Mixes a colour into all pixels between two corners, by the share that it has of each.
    fn cover(&mut self, from: DVec2, to: DVec2, color: Vec3, share: impl Fn(DVec2) -> f64) {
        let Image { width, height, pixels } = &mut self.image;
        let first = |x: f64| (x - 1.0).floor().max(0.0) as u32;
        let last = |x: f64, side: u32| ((x + 1.0).ceil().max(0.0) as u32).min(side);
        for y in first(from.y)..last(to.y, *height) {
            for x in first(from.x)..last(to.x, *width) {
                let share = share(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)) as f32;
                let pixel = &mut pixels[(y * *width + x) as usize];
                *pixel = pixel.lerp(color.extend(1.0), share);
            }
        }
    }
}

/// The share of a pixel that is inside of an edge at this distance from its middle.
fn edge(inside: f64) -> f64 {
    (inside + 0.5).clamp(0.0, 1.0)
}

/// `#rrggbb` as light; black for anything else.
fn parsed(color: &str) -> Vec3 {
    let channel =
        |i: usize| color.get(1 + 2 * i..3 + 2 * i).and_then(|digits| u8::from_str_radix(digits, 16).ok()).unwrap_or(0);
    Vec3::from_array([0, 1, 2].map(|i| srgb_to_linear(channel(i))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How much black there is, in pixels.
    fn black(image: &Image) -> f32 {
        image.pixels.iter().map(|pixel| 1.0 - pixel.x).sum()
    }

    #[test]
    fn as_much_is_black_as_was_drawn() {
        let mut drawing = Drawing::new();
        drawing.rectangle((1.25, 2.5), (3.5, 2.25), "#000000");
        let image = drawing.pixels(10.0, 8.0, 2.0);
        assert_eq!((image.width, image.height), (20, 16));
        assert!((black(&image) - 4.0 * 3.5 * 2.25).abs() < 1e-3, "{}", black(&image));
        let mut drawing = Drawing::new();
        drawing.stroke((10.0, 10.0), (40.0, 30.0), "#000000", 3.0);
        let area = 3.0 * (30f32 * 30.0 + 20.0 * 20.0).sqrt() + std::f32::consts::PI * 1.5 * 1.5;
        assert!((black(&drawing.pixels(50.0, 50.0, 1.0)) / area - 1.0).abs() < 0.02);
        let mut drawing = Drawing::new();
        drawing.dot((20.0, 20.0), 10.0, "#000000");
        let area = std::f32::consts::PI * 9.5 * 9.5;
        assert!((black(&drawing.pixels(40.0, 40.0, 1.0)) / area - 1.0).abs() < 0.02);
    }

    #[test]
    fn text_stands_where_it_should_in_its_colour() {
        let font = Font { size: 20.0, bold: false, color: "#ff0000" };
        let image = |anchor, turned| {
            let mut drawing = Drawing::new();
            let at = (100.0, 100.0);
            if turned {
                drawing.text_upwards(at, anchor, font, "HHH")
            } else {
                drawing.text(at, anchor, font, "HHH")
            }
            drawing.pixels(200.0, 200.0, 1.0)
        };
        let bounds = |image: &Image| {
            let covered = (0..200u32 * 200).filter(|&i| image.pixels[i as usize].y < 0.5);
            let covered: Vec<_> = covered.map(|i| (i % 200, i / 200)).collect();
            let x = covered.iter().map(|p| p.0);
            let y = covered.iter().map(|p| p.1);
            [x.clone().min(), x.max(), y.clone().min(), y.max()].map(|side| side.expect("something is drawn"))
        };
        let [left, right, top, bottom] = bounds(&image(Anchor::Start, false));
        assert!((98..=102).contains(&left) && right > 120 && top > 80 && (99..=102).contains(&bottom));
        let [left, right, ..] = bounds(&image(Anchor::End, false));
        assert!(left < 80 && (98..=102).contains(&right));
        let [left, right, ..] = bounds(&image(Anchor::Middle, false));
        assert!((left + right).abs_diff(200) <= 3);
        let [left, right, top, bottom] = bounds(&image(Anchor::Start, true));
        assert!(left > 80 && (99..=102).contains(&right) && top < 80 && (98..=102).contains(&bottom));
        let red = image(Anchor::Start, false).pixels.iter().all(|pixel| pixel.x > 0.99);
        assert!(red, "red on white");
    }

    #[test]
    fn what_is_outside_is_left_out() {
        let mut drawing = Drawing::new();
        drawing.rectangle((-50.0, -50.0), (1000.0, 10.0), "#000000");
        drawing.stroke((-10.0, 500.0), (1e6, 1e6), "nothing", 2.0);
        drawing.dot((5.0, -100.0), 3.0, "#123456");
        assert_eq!(black(&drawing.pixels(10.0, 10.0, 1.0)), 0.0);
    }
}
