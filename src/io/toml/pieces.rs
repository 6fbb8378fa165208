//! Placements and primitives, cut out of the text and read some thousands at a time.
//!
//! A tree of the whole file takes 3 kB for each `[[sphere]]` and 8 kB for each `[[instance]]`: a list of tokens, one of
//! events, and a B-tree with room for eleven keys for each table. Those tables are what files have by the million, and
//! none depends on another. So where there are many at the top of a file, they are taken out of the text; the rest is
//! parsed as ever, and they are parsed in pieces, by all threads, of which only what they say is kept. A parser of our
//! own, without a tree, would know TOML a second time.
//!
//! To find them it is enough to know where strings, comments and lists end. In a text that is no TOML something else
//! may be cut; then a piece or the rest is no TOML either, and is refused for it.

use std::ops::Range;

/// Fewer tables than this are left where they are.
const FEW: usize = 4096;
/// Tables of a piece.
const PIECE: usize = 1024;

/// A text without the tables of some lists, and these.
pub(super) struct Cut {
    /// The text, with spaces in place of what was cut, so that offsets are those of the file.
    pub(super) rest: String,
    /// What was cut, in order.
    pub(super) pieces: Vec<Range<usize>>,
}

impl Cut {
    /// Cuts out the tables `[[key]]` of all these keys. None where little is to be cut.
    pub(super) fn new(text: &str, keys: &[&str]) -> Option<Self> {
        Self::of_pieces(text, keys, FEW, PIECE)
    }

    fn of_pieces(text: &str, keys: &[&str], few: usize, piece: usize) -> Option<Self> {
        let runs = tables(text.as_bytes(), keys)?;
        if runs.len() < few {
            return None;
        }
        let mut pieces: Vec<Range<usize>> = Vec::new();
        let mut in_last = 0;
        for run in runs {
            match pieces.last_mut() {
                Some(last) if last.end == run.start && in_last < piece => {
                    last.end = run.end;
                    in_last += 1;
                }
                _ => {
                    pieces.push(run);
                    in_last = 1;
                }
            }
        }
        let mut rest = String::with_capacity(text.len());
        for piece in &pieces {
            rest.push_str(&text[rest.len()..piece.start]);
            rest.extend(std::iter::repeat_n(' ', piece.len()));
        }
        rest.push_str(&text[rest.len()..]);
        Some(Self { rest, pieces })
    }
}

/// Each table of one of the keys' lists at the top, up to the next header that is not part of it. None where a header
/// speaks of the last table of a list, and another list's came in between: that may be in another piece.
fn tables(text: &[u8], keys: &[&str]) -> Option<Vec<Range<usize>>> {
    let mut found: Vec<Range<usize>> = Vec::new();
    let mut open: Option<(usize, &str)> = None;
    for header in headers(text) {
        let line = text[header..].split(|&c| c == b'\n').next().unwrap_or_default();
        let next = match kind(line, keys) {
            // A table within the one that is open, of which its reader thinks what it will.
            Header::Within(key) if open.is_some_and(|(_, own)| own == key) => continue,
            Header::Within(_) => return None,
            Header::Own(key) => Some((header, key)),
            Header::Other => None,
        };
        found.extend(open.map(|(start, _)| start..header));
        open = next;
    }
    found.extend(open.map(|(start, _)| start..text.len()));
    Some(found)
}

enum Header<'a> {
    /// `[[key]]`.
    Own(&'a str),
    /// `[key.` or `[[key.`.
    Within(&'a str),
    Other,
}

fn kind<'a>(line: &[u8], keys: &[&'a str]) -> Header<'a> {
    let brackets = line.iter().take_while(|&&c| c == b'[').count();
    let name = line[brackets..].trim_ascii_start();
    let length = name.iter().take_while(|c| c.is_ascii_alphanumeric() || matches!(c, b'_' | b'-')).count();
    let Some(&key) = keys.iter().find(|key| key.as_bytes() == &name[..length]) else { return Header::Other };
    let after = &name[length..];
    let after = &after[after.iter().take_while(|c| matches!(c, b' ' | b'\t')).count()..];
    match (brackets, after.first()) {
        (2, Some(b']')) => Header::Own(key),
        (_, Some(b'.')) => Header::Within(key),
        _ => Header::Other,
    }
}

/// Where lines begin with a bracket that is not within a value.
fn headers(text: &[u8]) -> impl Iterator<Item = usize> + '_ {
    let (mut at, mut depth, mut starts_line) = (0, 0u32, true);
    std::iter::from_fn(move || {
        while let Some(&c) = text.get(at) {
            let here = at;
            at += 1;
            match c {
                b' ' | b'\t' => continue,
                b'\n' => {
                    starts_line = true;
                    continue;
                }
                b'#' => at = end_of_line(text, at),
                b'[' if starts_line && depth == 0 => {
                    at = end_of_line(text, at);
                    return Some(here);
                }
                b'[' | b'{' => depth += 1,
                b']' | b'}' => depth = depth.saturating_sub(1),
                b'"' | b'\'' => at = end_of_string(text, here),
                _ => {}
            }
            starts_line = false;
        }
        None
    })
}

fn end_of_line(text: &[u8], from: usize) -> usize {
    memchr::memchr(b'\n', &text[from..]).map_or(text.len(), |length| from + length)
}

/// Behind the string that begins at `from`; at the end of the line where it has no end.
fn end_of_string(text: &[u8], from: usize) -> usize {
    let quote = text[from];
    let is_long = text[from..].starts_with(&[quote; 3]);
    let mut at = from + if is_long { 3 } else { 1 };
    while let Some(&c) = text.get(at) {
        match c {
            b'\\' if quote == b'"' => at += 2,
            b'\n' if !is_long => return at,
            _ if c == quote && !is_long => return at + 1,
            _ if c == quote && text[at..].starts_with(&[quote; 3]) => {
                // One or two quotes more may be the string's last characters.
                let more = text[at + 3..].iter().take(2).take_while(|&&c| c == quote).count();
                return at + 3 + more;
            }
            _ => at += 1,
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEYS: [&str; 2] = ["instance", "box"];

    fn cut(text: &str) -> (String, Vec<&str>) {
        let cut = Cut::of_pieces(text, &KEYS, 1, 2).expect("something to cut");
        assert_eq!(cut.rest.len(), text.len());
        (cut.rest, cut.pieces.into_iter().map(|piece| &text[piece]).collect())
    }

    #[test]
    fn placements_are_cut_and_the_rest_stays_in_its_place() {
        let (rest, pieces) =
            cut("a = 1\n[[instance]]\nx = 1\n[[ instance ]] # one\nx = 2\n[b]\nc = 2\n[[instance]]\nx = 3");
        assert_eq!(pieces, ["[[instance]]\nx = 1\n[[ instance ]] # one\nx = 2\n", "[[instance]]\nx = 3"]);
        assert_eq!(rest.split_whitespace().collect::<Vec<_>>().join(" "), "a = 1 [b] c = 2");
        let three = "[[instance]]\n".repeat(3);
        assert_eq!(cut(&three).1, [&three[..26], &three[26..]], "two to a piece");
        let within = "[[instance]]\n[instance.transform]\nscale = 2\n";
        assert_eq!(cut(within).1, [within]);
        let mixed = "[[instance]]\n[instance.a]\n[[box]]\n[box.a]\n[[instance]]\n";
        let third = mixed.rfind("[[").expect("a third");
        assert_eq!(cut(mixed).1, [&mixed[..third], &mixed[third..]]);
    }

    #[test]
    fn what_only_looks_like_a_placement_is_left() {
        for text in [
            "a = \"\"\"\n[[instance]]\n\"\"\"\n",
            "a = '''\n[[instance]]\n'''\n",
            "a = \"\"\"\\\"\"\"\n[[instance]]\n\"\"\"\"\"\n",
            "a = [\n[[instance]]\n]\n",
            "a = { b = [ # ]\n[[instance]]\n] }\n",
            "# [[instance]]\n",
            "[[instances]]\n",
            "[instance]\n",
            "[instance.a]\n",
            "[[\"instance\"]]\n",
            "[[group.a.instance]]\n",
            "[[instance]]\n[[box]]\n[instance.a]\n",
            "[[instance]]\n[b]\n[instance.a]\n",
            "[[boxes]]\n[[box-es]]\n[[bo]]\n",
            "x = 1 [[instance]]\n",
        ] {
            assert!(Cut::of_pieces(text, &KEYS, 1, 2).is_none(), "{text}");
        }
        // Strings and comments that end in their line do not hide what follows.
        for before in ["a = '['", "a = \"[\\\"\"", "# [", "a = [1, 2]", "a = \"\"\"x\"\"\"\"", "a = 'no end"] {
            assert_eq!(cut(&format!("{before}\n[[instance]]\n")).1, ["[[instance]]\n"], "{before}");
        }
    }
}
