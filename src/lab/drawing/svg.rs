//! The few elements of SVG 1.1 that a chart needs, written as text, an element a line.

use std::fmt::Write;

use super::{Anchor, Drawing, Element};

impl Drawing {
    /// The whole document, on white.
    pub fn svg(&self, width: f64, height: f64) -> String {
        let mut body = String::new();
        for element in &self.elements {
            // A String takes everything.
            _ = write_element(&mut body, element);
        }
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"Helvetica, Arial, DejaVu Sans, sans-serif\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n{body}</svg>\n",
        )
    }
}

fn write_element(out: &mut String, element: &Element) -> std::fmt::Result {
    match element {
        Element::Text { at: (x, y), anchor, font, turned, text } => {
            let anchor = match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            let weight = if font.bold { " font-weight=\"bold\"" } else { "" };
            let turn = if *turned { format!(" transform=\"rotate(-90 {x:.1} {y:.1})\"") } else { String::new() };
            let (size, color, text) = (font.size, font.color, escaped(text));
            writeln!(
                out,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\"{weight} fill=\"{color}\"{turn}>{text}</text>"
            )
        }
        Element::Rectangle { at: (x, y), size: (width, height), color } => writeln!(
            out,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{color}\"/>"
        ),
        Element::Line { from: (x, y), to: (to_x, to_y), color, width } => {
            let width = if *width == 1.0 { String::new() } else { format!(" stroke-width=\"{width}\"") };
            writeln!(
                out,
                "<line x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{to_x:.1}\" y2=\"{to_y:.1}\" stroke=\"{color}\"{width}/>"
            )
        }
        Element::Circle { at: (x, y), radius, fill, rim } => {
            writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{rim}\"/>")
        }
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
