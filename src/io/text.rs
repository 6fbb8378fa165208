//! Text files: lines, words and numbers, each with the line it stands in.
//!
//! Everything works on bytes. A file need not be UTF-8 as a whole (names in old files are in any encoding), and only
//! the words that are read as numbers are checked, which is also several times faster.

use std::borrow::Cow;

use super::number::Number;

/// A text without the mark that some editors put before UTF-8 (U+FEFF).
pub(super) fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

/// The length of the first line with its end (`\n`, `\r\n`, or `\r` alone, as programs of the old Macintosh wrote
/// them), and that without it.
pub(super) fn first_line(text: &[u8]) -> (usize, usize) {
    match memchr::memchr2(b'\n', b'\r', text) {
        Some(end) if text[end..].starts_with(b"\r\n") => (end + 2, end),
        Some(end) => (end + 1, end),
        None => (text.len(), text.len()),
    }
}

/// Lines of a text, numbered from 1, without their ends.
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

    /// The next line as it stands.
    pub(super) fn physical(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let (next, end) = first_line(self.rest);
        let line = &self.rest[..end];
        self.rest = &self.rest[next..];
        self.line += 1;
        Some(line)
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, Cow<'a, [u8]>);

    /// The next line and its number; lines that end in a backslash are joined with what follows, but where they end in
    /// a comment, which may be a path of Windows.
    fn next(&mut self) -> Option<Self::Item> {
        let line = self.physical()?;
        let number = self.line;
        let Some(begin) = continued(line) else {
            return Some((number, Cow::Borrowed(line)));
        };
        let mut joined = begin.to_vec();
        while let Some(line) = self.physical() {
            joined.push(b' ');
            match continued(line) {
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

/// What stands before the backslash that continues a line; none where there is none, or in a comment.
fn continued(line: &[u8]) -> Option<&[u8]> {
    let has_comment = || Words::new(line, 0).any(|word| word.starts_with(b"#"));
    line.strip_suffix(b"\\").filter(|_| !has_comment())
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
        self.at += first_line(&self.text[self.at..]).1;
    }

    /// The next word as a number. None where there is no word, or it is not a number.
    #[inline]
    pub(super) fn number<T: Number>(&mut self) -> Option<T> {
        self.number_or_word().ok()
    }

    /// The next word as a number, or what stands there instead, if anything does.
    #[inline]
    pub(super) fn number_or_word<T: Number>(&mut self) -> Result<T, Option<&'a [u8]>> {
        if let Some(number) = self.read(T::leading) {
            return Ok(number);
        }
        let word = self.next().ok_or(None)?;
        number(word).ok_or(Some(word))
    }

    /// What `read` makes of the next word, if it takes all of it; else the word stays where it is. `read` sees the text
    /// from there on, and says how many bytes it takes: so each is read once, and not to find the word's end before.
    #[inline]
    pub(super) fn read<T>(&mut self, read: impl FnOnce(&'a [u8]) -> Option<(T, usize)>) -> Option<T> {
        let (begin, line) = self.begin();
        let (value, length) = read(&self.text[begin..])?;
        let is_whole = self.text.get(begin + length).is_none_or(|b| is_space(*b));
        is_whole.then(|| {
            (self.at, self.line) = (begin + length, line);
            value
        })
    }

    /// Where the next word begins, and in which line; the end of the text, if there is none.
    #[inline]
    fn begin(&self) -> (usize, usize) {
        let (mut at, mut line) = (self.at, self.line);
        while let Some(b) = self.text.get(at).filter(|b| is_space(**b)) {
            at += 1;
            line += usize::from(*b == b'\n' || *b == b'\r' && self.text.get(at) != Some(&b'\n'));
        }
        (at, line)
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let (begin, line) = self.begin();
        self.at = begin;
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

/// A word as a number; floats may be `nan` and `inf`, and what Microsoft's libraries write for them.
#[inline]
pub(super) fn number<T: Number>(word: &[u8]) -> Option<T> {
    match T::leading(word) {
        Some((number, length)) if length == word.len() => Some(number),
        _ => {
            let word = str::from_utf8(word).ok()?;
            word.parse().ok().or_else(|| not_finite(word)?.parse().ok())
        }
    }
}

/// The usual spelling of `-nan(ind)`, `1.#QNAN`, `-1.#INF000` and the like.
fn not_finite(word: &str) -> Option<&'static str> {
    let lower = word.to_ascii_lowercase();
    let (is_negative, size) = lower.strip_prefix('-').map_or((false, &lower[..]), |size| (true, size));
    let size = size.strip_prefix('+').unwrap_or(size);
    let kind = size.strip_prefix("1.#").unwrap_or_default();
    if size.starts_with("nan(") || ["ind", "qnan", "snan"].iter().any(|nan| kind.starts_with(nan)) {
        return Some("nan");
    }
    kind.starts_with("inf").then_some(if is_negative { "-inf" } else { "inf" })
}

/// Bytes for a message: as text in quotes, shortened to 40 characters.
pub(super) fn quoted(bytes: &[u8]) -> String {
    format!("{:?}", excerpt(bytes))
}

/// Bytes as text, shortened to 40 characters.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(160)]);
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() || bytes.len() > 160 {
        short.push('…');
    }
    short
}

/// A name in a file, as text. One that is not UTF-8 is taken for Latin-1, in which every byte is a letter: whatever it
/// was written in, names that differ stay different.
pub(super) fn name(bytes: &[u8]) -> String {
    let bytes = bytes.trim_ascii();
    str::from_utf8(bytes).map_or_else(|_| bytes.iter().copied().map(char::from).collect(), str::to_owned)
}

/// What of a name stands before a comment: a `#` behind white space. Names hold both, so that the whole is to be tried
/// before.
pub(super) fn before_comment(name: &str) -> &str {
    let begin = name.match_indices('#').map(|(at, _)| at).find(|at| name[..*at].ends_with(char::is_whitespace));
    begin.map_or(name, |at| name[..at].trim_end())
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
        let lines: Vec<_> = Lines::new(b" # C:\\\nv 1 # D:\\\n").map(|(n, l)| (n, l.into_owned())).collect();
        assert_eq!(lines, [(1, b" # C:\\".to_vec()), (2, b"v 1 # D:\\".to_vec())]);
        let lines: Vec<_> = Lines::new(b"f 1 2 \\\n3 # C:\\\nf 2\n").map(|(n, l)| (n, l.into_owned())).collect();
        assert_eq!(lines, [(1, b"f 1 2  3 # C:\\".to_vec()), (3, b"f 2".to_vec())]);
        let lines: Vec<_> = Lines::new(b"a\rb \\\rc\r\rd\n\re\r").map(|(n, l)| (n, l.into_owned())).collect();
        assert_eq!(
            lines,
            [
                (1, b"a".to_vec()),
                (2, b"b  c".to_vec()),
                (4, vec![]),
                (5, b"d".to_vec()),
                (6, vec![]),
                (7, b"e".to_vec())
            ]
        );
    }

    #[test]
    fn what_is_not_finite_is_written_in_many_ways() {
        for word in ["nan", "-NaN", "-nan(ind)", "nan(snan)", "1.#QNAN", "-1.#IND", "1.#SNAN00", "+1.#IND"] {
            assert!(number::<f64>(word.as_bytes()).is_some_and(f64::is_nan), "{word}");
        }
        for (word, sign) in [("inf", 1.0), ("-inf", -1.0), ("1.#INF", 1.0), ("-1.#INF00", -1.0)] {
            assert_eq!(number::<f32>(word.as_bytes()), Some(f32::INFINITY * sign), "{word}");
        }
        for word in ["1.#", "1.#x", "n", "1.5#QNAN", ""] {
            assert_eq!(number::<f64>(word.as_bytes()), None, "{word}");
        }
        assert_eq!(number::<i32>(b"1.#QNAN"), None);
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
        let mut words = Words::new(b"1\r2 x\r\n3\r\r4\n\r5", 1);
        let mut read = || (words.number::<i32>(), words.line);
        assert_eq!([read(), read()], [(Some(1), 1), (Some(2), 2)]);
        words.skip_line();
        let mut read = || (words.number::<i32>(), words.line);
        assert_eq!([read(), read(), read()], [(Some(3), 3), (Some(4), 5), (Some(5), 7)]);
    }

    /// A number is one word, whichever way it is read.
    #[test]
    fn words_that_only_begin_as_numbers_are_none() {
        let mut words = Words::new(b"1.5x\n-2e3 7/2 nan \n", 1);
        assert_eq!(words.number_or_word::<f64>(), Err(Some(&b"1.5x"[..])));
        assert_eq!((words.read(f64::leading), words.line), (Some(-2000.0), 2));
        assert_eq!(words.read(f64::leading), None);
        assert_eq!(words.next(), Some(&b"7/2"[..]));
        assert!(words.number::<f32>().is_some_and(f32::is_nan));
        assert_eq!((words.number_or_word::<f64>(), words.line), (Err(None), 2));
    }

    #[test]
    fn names_that_differ_stay_different() {
        assert_eq!((name(b" T\xfcr\t"), name("Tür".as_bytes())), ("Tür".to_owned(), "Tür".to_owned()));
        // Red and green, in GBK.
        assert_ne!(name(b"\xba\xec"), name(b"\xc2\xcc"));
    }

    #[test]
    fn messages_stay_short() {
        assert_eq!(quoted(b"abc"), "\"abc\"");
        assert_eq!(quoted(&[b'x'; 1000]).chars().count(), 43);
        assert_eq!(quoted(&[0xff; 3]), format!("{:?}", "\u{fffd}".repeat(3)));
    }
}
