//! The few elements of SVG 1.1 that a chart needs, written as text.

use std::fmt::Write;

/// A picture that grows downwards.
pub(in crate::lab) struct Svg {
    body: String,
}

/// Where a text's x is.
#[derive(Clone, Copy)]
pub(in crate::lab) enum Anchor {
    Start,
    Middle,
    End,
}

/// How a text looks.
#[derive(Clone, Copy)]
pub(in crate::lab) struct Font {
    pub size: f64,
    pub bold: bool,
    pub color: &'static str,
}

impl Svg {
    pub const fn new() -> Self {
        Self { body: String::new() }
    }

    /// `y` is the line that letters stand on.
    pub fn text(&mut self, (x, y): (f64, f64), anchor: Anchor, font: Font, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let weight = if font.bold { " font-weight=\"bold\"" } else { "" };
        let (size, color, text) = (font.size, font.color, escaped(text));
        self.element(format_args!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\"{weight} fill=\"{color}\">{text}</text>"
        ));
    }

    pub fn rectangle(&mut self, (x, y): (f64, f64), (width, height): (f64, f64), color: &str) {
        self.element(format_args!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{color}\"/>"
        ));
    }

    pub fn line(&mut self, (x, y): (f64, f64), (to_x, to_y): (f64, f64), color: &str) {
        self.element(format_args!(
            "<line x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{to_x:.1}\" y2=\"{to_y:.1}\" stroke=\"{color}\"/>"
        ));
    }

    /// A ring, white inside.
    pub fn ring(&mut self, (x, y): (f64, f64), radius: f64, color: &str) {
        self.element(format_args!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"white\" stroke=\"{color}\"/>"
        ));
    }

    fn element(&mut self, element: std::fmt::Arguments<'_>) {
        // A String takes everything.
        _ = writeln!(self.body, "{element}");
    }

    /// The whole document, on white.
    pub fn finish(self, width: f64, height: f64) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"Helvetica, Arial, DejaVu Sans, sans-serif\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n{}</svg>\n",
            self.body
        )
    }
}

/// What XML may hold: without markup, and without control characters, which it has no way to write.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\u{fffe}' | '\u{ffff}' => out.push(char::REPLACEMENT_CHARACTER),
            c if c.is_control() => out.push(char::REPLACEMENT_CHARACTER),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_the_markup() {
        assert_eq!(escaped("a<b>&\"c\"\u{1}\n é"), "a&lt;b&gt;&amp;&quot;c&quot;\u{fffd}\u{fffd} é");
    }
}
