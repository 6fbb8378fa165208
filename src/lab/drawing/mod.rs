//! Charts as a list of a few kinds of elements, which become SVG or pixels.
//!
//! | file | idea |
//! | --- | --- |
//! | `svg` | the elements as text |
//! | `raster` | the elements as pixels |
//! | `letters` | the letters of the pixels: strokes on a grid |
//!
//! A library that draws charts, or one that turns SVG into pixels, would do more and weigh more than the program; a
//! chart needs lines, bars, circles and plain letters.

mod letters;
mod raster;
mod svg;

/// A picture that grows downwards, in units of a screen's pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct Drawing {
    elements: Vec<Element>,
}

/// Where a text's x is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// How a text looks. Colours are `#rrggbb`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Font {
    pub size: f64,
    pub bold: bool,
    pub color: &'static str,
}

/// What is drawn, in order.
#[derive(Clone, Debug)]
enum Element {
    /// On the line that letters stand on; upwards where `turned`.
    Text {
        at: (f64, f64),
        anchor: Anchor,
        font: Font,
        turned: bool,
        text: String,
    },
    Rectangle {
        at: (f64, f64),
        size: (f64, f64),
        color: String,
    },
    Line {
        from: (f64, f64),
        to: (f64, f64),
        color: String,
        width: f64,
    },
    /// Filled with one colour, with a rim of another.
    Circle {
        at: (f64, f64),
        radius: f64,
        fill: String,
        rim: String,
    },
}

impl Drawing {
    pub const fn new() -> Self {
        Self { elements: Vec::new() }
    }

    /// `y` is the line that letters stand on.
    pub fn text(&mut self, at: (f64, f64), anchor: Anchor, font: Font, text: &str) {
        self.elements.push(Element::Text { at, anchor, font, turned: false, text: text.to_owned() });
    }

    /// From the bottom to the top.
    pub fn text_upwards(&mut self, at: (f64, f64), anchor: Anchor, font: Font, text: &str) {
        self.elements.push(Element::Text { at, anchor, font, turned: true, text: text.to_owned() });
    }

    pub fn rectangle(&mut self, at: (f64, f64), size: (f64, f64), color: &str) {
        self.elements.push(Element::Rectangle { at, size, color: color.to_owned() });
    }

    pub fn line(&mut self, from: (f64, f64), to: (f64, f64), color: &str) {
        self.stroke(from, to, color, 1.0);
    }

    /// A line of any width.
    pub fn stroke(&mut self, from: (f64, f64), to: (f64, f64), color: &str, width: f64) {
        self.elements.push(Element::Line { from, to, color: color.to_owned(), width });
    }

    /// A ring, white inside.
    pub fn ring(&mut self, at: (f64, f64), radius: f64, color: &str) {
        self.elements.push(Element::Circle { at, radius, fill: "#ffffff".to_owned(), rim: color.to_owned() });
    }

    /// A disk with a white rim.
    pub fn dot(&mut self, at: (f64, f64), radius: f64, color: &str) {
        self.elements.push(Element::Circle { at, radius, fill: color.to_owned(), rim: "#ffffff".to_owned() });
    }
}
