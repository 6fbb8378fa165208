//! Stretches of whole lines, and where they begin in the file's lists.

use rayon::prelude::*;

use crate::io::text::{Lines, Words, first_line};

/// The least bytes of a stretch, the last apart.
const LENGTH: usize = 1 << 20;

/// What comes before a stretch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Begin {
    /// Lines.
    pub(super) line: usize,
    /// Positions, texture coordinates and normals.
    pub(super) counts: [usize; 3],
}

/// Divides a text after ends of lines that are not continued in the next.
pub(super) fn divide(text: &[u8]) -> Vec<&[u8]> {
    divide_at(text, LENGTH)
}

fn divide_at(mut text: &[u8], length: usize) -> Vec<&[u8]> {
    let mut stretches = Vec::new();
    while !text.is_empty() {
        let mut end = length.min(text.len());
        end = loop {
            let (next, line) = first_line(&text[end..]);
            // Between `\r` and `\n` no line begins.
            let line = &text[..end + line];
            let is_continued = line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\");
            end += next;
            if !is_continued || end == text.len() {
                break end;
            }
        };
        let (stretch, rest) = text.split_at(end);
        stretches.push(stretch);
        text = rest;
    }
    stretches
}

/// Where each stretch begins, and how many of each list there are in all.
pub(super) fn begins(stretches: &[&[u8]]) -> (Vec<Begin>, [usize; 3]) {
    let counted: Vec<Begin> = stretches.par_iter().map(|text| count(text)).collect();
    let mut sum = Begin::default();
    let mut begins = Vec::with_capacity(counted.len());
    for one in counted {
        begins.push(sum);
        sum.line += one.line;
        sum.counts = std::array::from_fn(|k| sum.counts[k] + one.counts[k]);
    }
    (begins, sum.counts)
}

/// How many lines and statements of each list a stretch has.
fn count(text: &[u8]) -> Begin {
    let mut counts = [0; 3];
    let mut lines = Lines::new(text);
    for (line, text) in lines.by_ref() {
        match Words::new(&text, line).next() {
            Some(b"v") => counts[0] += 1,
            Some(b"vt") => counts[1] += 1,
            Some(b"vn") => counts[2] += 1,
            _ => {}
        }
    }
    Begin { line: lines.line(), counts }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_are_whole_lines() {
        let text = b"v 1\nvt \\\nv 2\r\n vn 1\n\nvv\nv 3 \\\r\n4\nf";
        assert_eq!(divide_at(text, 1000), [text]);
        let stretches = divide_at(text, 1);
        let expected: [&[u8]; 7] = [b"v 1\n", b"vt \\\nv 2\r\n", b" vn 1\n", b"\nvv\n", b"v 3 \\\r\n4\n", b"f", b""];
        assert_eq!(stretches, expected[..6]);
        let (begins, counts) = begins(&stretches);
        assert_eq!((begins[5].line, counts), (8, [2, 1, 1]));
        assert_eq!(begins[2], Begin { line: 3, counts: [1, 1, 0] });
        assert!(divide(b"").is_empty());
    }

    /// Wherever a text is divided, it has the lines that it has as a whole, however these end.
    #[test]
    fn no_line_is_cut() {
        let text = "v 1\nvt \\\nv 2\n vn 1\n\nvv\nv 3 \\\n\n4\nf";
        for end in ["\n", "\r\n", "\r"] {
            let text = text.replace('\n', end).into_bytes();
            let whole: Vec<_> = Lines::new(&text).map(|(_, line)| line).collect();
            assert_eq!(whole, ["v 1", "vt  v 2", " vn 1", "", "vv", "v 3  ", "4", "f"].map(str::as_bytes));
            for length in 1..text.len() {
                let stretches = divide_at(&text, length);
                let lines: Vec<_> =
                    stretches.iter().flat_map(|stretch| Lines::new(stretch)).map(|(_, line)| line).collect();
                assert_eq!((lines, stretches.concat() == text), (whole.clone(), true), "{end:?}, {length} bytes");
            }
        }
    }
}
