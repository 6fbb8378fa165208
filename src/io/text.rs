//! Text files: lines, words and numbers, each with the line it stands in.
//!
//! Everything works on bytes. A file need not be UTF-8 as a whole (names in old files are in any encoding), and only
//! the words that are read as numbers are checked, which is also several times faster.

use std::borrow::Cow;
use std::str::FromStr;

/// A text without the mark that some editors put before UTF-8 (U+FEFF).
pub(super) fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

/// Lines of a text, numbered from 1, without their ends (`\n` or `\r\n`).
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { rest: text, line: 0 }
    }

    /// Lines that have been read so far, joined ones counted as they stand.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    fn physical(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let end = memchr::memchr(b'\n', self.rest).unwrap_or(self.rest.len());
        let line = &self.rest[..end];
        self.rest = self.rest.get(end + 1..).unwrap_or_default();
        self.line += 1;
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, Cow<'a, [u8]>);

    /// The next line and its number; lines that end in a backslash are joined with what follows.
    fn next(&mut self) -> Option<Self::Item> {
        let line = self.physical()?;
        let number = self.line;
        let Some(begin) = line.strip_suffix(b"\\") else {
            return Some((number, Cow::Borrowed(line)));
        };
        let mut joined = begin.to_vec();
        while let Some(line) = self.physical() {
            joined.push(b' ');
            match line.strip_suffix(b"\\") {
                Some(part) => joined.extend_from_slice(part),
                None => {
                    joined.extend_from_slice(line);
                    break;
                }
            }
        }
        Some((number, Cow::Owned(joined)))
    }
}

/// Words of a text, and the line that the last one stood in.
pub(super) struct Words<'a> {
    text: &'a [u8],
    at: usize,
    /// Of the word that was given last, from 1.
    pub(super) line: usize,
}

impl<'a> Words<'a> {
    /// The words of `text`, whose first line has the number `line`.
    pub(super) fn new(text: &'a [u8], line: usize) -> Self {
        Self { text, at: 0, line }
    }

    /// What has not been read yet, in bytes.
    pub(super) fn remaining(&self) -> usize {
        self.text.len() - self.at
    }

    /// The rest of the text, without white space at its ends.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.text[self.at..].trim_ascii()
    }

    /// Skips to the end of the line.
    pub(super) fn skip_line(&mut self) {
        let rest = &self.text[self.at..];
        self.at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
    }

    /// The next word as a number. None where there is no word, or it is not a number.
    #[inline]
    pub(super) fn number<T: FromStr>(&mut self) -> Option<T> {
        number(self.next()?)
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let mut line = self.line;
        while let Some(b) = self.text.get(self.at).filter(|b| is_space(**b)) {
            line += usize::from(*b == b'\n');
            self.at += 1;
        }
        let begin = self.at;
        while self.text.get(self.at).is_some_and(|b| !is_space(*b)) {
            self.at += 1;
        }
        // At the end of the text the line stays the last word's.
        (self.at > begin).then(|| {
            self.line = line;
            &self.text[begin..self.at]
        })
    }
}

#[inline]
fn is_space(b: u8) -> bool {
    matches!(b, b' ' | b'\t'..=b'\r')
}

/// A word as a number; floats may be `nan` and `inf`.
#[inline]
pub(super) fn number<T: FromStr>(word: &[u8]) -> Option<T> {
    str::from_utf8(word).ok()?.parse().ok()
}

/// Bytes for a message: as text, shortened to 40 characters.
pub(super) fn quoted(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(160)]);
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() || bytes.len() > 160 {
        short.push('…');
    }
    format!("{short:?}")
}

/// A name in a file, as text.
pub(super) fn name(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes.trim_ascii()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_numbered_and_joined() {
        let lines: Vec<_> = Lines::new(b"a\r\nb \\\nc\\\r\n d\n\ne").collect();
        let text: Vec<_> = lines.iter().map(|(n, l)| (*n, str::from_utf8(l).unwrap())).collect();
        assert_eq!(text, [(1, "a"), (2, "b  c  d"), (5, ""), (6, "e")]);
        assert_eq!(Lines::new(b"x\\").next().unwrap(), (1, Cow::Borrowed(&b"x"[..])));
        assert_eq!(Lines::new(b"").next(), None);
    }

    #[test]
    fn words_know_their_line() {
        let mut words = Words::new(b" 1 2\n\n 3e2 x", 7);
        assert_eq!((words.number::<i32>(), words.line), (Some(1), 7));
        assert_eq!(words.rest(), b"2\n\n 3e2 x");
        words.skip_line();
        assert_eq!((words.number::<f32>(), words.line), (Some(300.0), 9));
        assert_eq!((words.number::<f32>(), words.line), (None, 9));
        assert_eq!(words.next(), None);
        assert_eq!(words.remaining(), 0);
    }

    #[test]
    fn messages_stay_short() {
        assert_eq!(quoted(b"abc"), "\"abc\"");
        assert_eq!(quoted(&[b'x'; 1000]).chars().count(), 43);
        assert_eq!(quoted(&[0xff; 3]), format!("{:?}", "\u{fffd}".repeat(3)));
    }
}
