//! All charts as one page that needs nothing else.

use std::fmt::Write;

use super::Figure;

const STYLE: &str = "body{font-family:Helvetica,Arial,'DejaVu Sans',sans-serif;color:#222;max-width:960px;margin:2em auto;padding:0 1em}\
                     figure{margin:0 0 3em}figcaption{font-size:.9em;color:#444;line-height:1.45}svg{max-width:100%;height:auto}";

/// An HTML page with the charts in it, and links to their numbers beside it.
pub fn page(figures: &[Figure]) -> String {
    let mut body = String::new();
    for figure in figures {
        let Figure { name, caption, title, .. } = figure;
        let links = format!(
            "<a href=\"{name}.csv\">numbers</a>, <a href=\"{name}.png\">PNG</a>, <a href=\"{name}.svg\">SVG</a>"
        );
        let (drawing, title, caption) = (figure.svg(), escaped(title), escaped(caption));
        // A String takes everything.
        _ = writeln!(
            body,
            "<figure id=\"{name}\">\n{drawing}<figcaption><b>{title}.</b> {caption} ({links})</figcaption>\n</figure>"
        );
    }
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>Twincast: speed against accuracy</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<h1>Speed against accuracy</h1>\n\
         <p>Made by <code>twincast chart</code>. Times move with the machine and whatever else it does: compare within a chart. Counts of \
         wrong answers are the same everywhere.</p>\n{body}</body>\n</html>\n"
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::drawing::Drawing;

    #[test]
    fn a_page_holds_all_that_it_shows() {
        let mut drawing = Drawing::new();
        drawing.dot((1.0, 2.0), 3.0, "#123456");
        let figure = |name, title: &str| Figure {
            name,
            title: title.to_owned(),
            caption: "less < more & so on".to_owned(),
            csv: String::new(),
            drawing: drawing.clone(),
            size: (10.0, 10.0),
        };
        let page = page(&[figure("one", "First"), figure("two", "Second")]);
        assert_eq!(page.matches("<svg ").count(), 2);
        assert_eq!(page.matches("less &lt; more &amp; so on").count(), 2);
        assert!(page.contains("href=\"two.csv\"") && page.contains("<b>Second.</b>"));
        // Nothing is loaded: what is referred to are the files beside it, which are links.
        assert!(!page.contains("src=") && !page.contains("<script") && !page.contains("@import"));
    }
}
