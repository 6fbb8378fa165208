//! Statements of line-based scene files: a keyword, and arguments that are nearly all numbers.
//!
//! A `#` at the beginning of a word starts a comment. What is wrong with a statement is said with the word, and with
//! what the statement looks like when it is right.

use std::iter;

use super::Placeless;
use super::text::{Lines, Words, number, quoted, without_mark};
use crate::math::{DVec3, Vec3};
use crate::scene::{MAX_DEPTH, MAX_SIDE};

/// One line with something on it.
pub(super) struct Statement<'a> {
    /// Its number, from 1.
    pub(super) line: usize,
    /// What it should look like, for messages; empty until the loader knows.
    pub(super) usage: &'static str,
    words: Words<'a>,
}

/// The statements of a text.
pub(super) fn statements(text: &[u8]) -> impl Iterator<Item = Statement<'_>> {
    let mut lines = Lines::new(without_mark(text));
    iter::from_fn(move || lines.physical()).zip(1..).filter_map(|(text, line)| {
        let words = Words::new(without_comment(text), line);
        let statement = Statement { line, usage: "", words };
        (!statement.words.rest().is_empty()).then_some(statement)
    })
}

fn without_comment(line: &[u8]) -> &[u8] {
    let begins_word = |&at: &usize| at == 0 || line[at - 1].is_ascii_whitespace();
    let comment = memchr::memchr_iter(b'#', line).find(begins_word);
    &line[..comment.unwrap_or(line.len())]
}

impl<'a> Statement<'a> {
    /// The next word.
    pub(super) fn word(&mut self) -> Placeless<&'a [u8]> {
        self.words.next().ok_or_else(|| format!("the line ends too early; expected {}", self.usage))
    }

    /// Whether words are left.
    pub(super) fn has_more(&self) -> bool {
        !self.words.rest().is_empty()
    }

    /// The next word as a finite number.
    pub(super) fn number(&mut self) -> Placeless<f64> {
        let word = self.word()?;
        let finite = number(word).filter(|x: &f64| x.is_finite());
        finite.ok_or_else(|| format!("{} where a finite number is expected: {}", quoted(word), self.usage))
    }

    /// The next `N` words as finite numbers.
    pub(super) fn numbers<const N: usize>(&mut self) -> Placeless<[f64; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number()?;
        }
        Ok(numbers)
    }

    /// Three numbers as a point or a vector.
    pub(super) fn vector(&mut self) -> Placeless<DVec3> {
        self.numbers().map(DVec3::from_array)
    }

    /// Three numbers as a direction, which is not zero. Its length may be any.
    pub(super) fn direction(&mut self) -> Placeless<DVec3> {
        let vector = self.vector()?;
        vector.try_normalize().ok_or_else(|| format!("{vector} has no direction; expected {}", self.usage))
    }

    /// The next word as a number that is not below 0, in single precision.
    pub(super) fn share(&mut self) -> Placeless<f32> {
        let number = self.number()?;
        let share = Some(number as f32).filter(|x| x.is_finite() && *x >= 0.0);
        let range = if number >= 0.0 { "up to 3.4e38" } else { "from 0 up" };
        share.ok_or_else(|| format!("{number} where a number {range} is expected: {}", self.usage))
    }

    /// Three such numbers as a linear colour.
    pub(super) fn color(&mut self) -> Placeless<Vec3> {
        Ok(Vec3::new(self.share()?, self.share()?, self.share()?))
    }

    /// The next word as a whole number.
    pub(super) fn whole(&mut self) -> Placeless<u32> {
        let word = self.word()?;
        number(word).ok_or_else(|| format!("{} where a whole number is expected: {}", quoted(word), self.usage))
    }

    /// Width and height of a picture.
    pub(super) fn picture_size(&mut self) -> Placeless<[u32; 2]> {
        let size = [self.whole()?, self.whole()?];
        let fits = size.iter().all(|side| (1..=MAX_SIDE).contains(side));
        let [width, height] = size;
        if fits { Ok(size) } else { Err(format!("{width} x {height} pixels; each side may be 1 to {MAX_SIDE}")) }
    }

    /// How often a ray may be sent on.
    pub(super) fn depth(&mut self) -> Placeless<u32> {
        let depth = self.whole()?;
        if depth <= MAX_DEPTH { Ok(depth) } else { Err(format!("a depth of {depth}; at most {MAX_DEPTH}")) }
    }

    /// An angle of view in degrees.
    pub(super) fn angle_of_view(&mut self) -> Placeless<f64> {
        let degrees = self.number()?;
        let inside = degrees > 0.0 && degrees < 180.0;
        if inside {
            Ok(degrees)
        } else {
            Err(format!("an angle of view of {degrees}; it must be above 0 and below 180"))
        }
    }

    /// Whether nothing is left.
    pub(super) fn end(&mut self) -> Placeless<()> {
        match self.words.next() {
            None => Ok(()),
            Some(word) => Err(format!("{} is one word too many; expected {}", quoted(word), self.usage)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_blank_lines_are_no_statements() {
        let text = b"# a\n\n a 1 2 # 3\r\n\t\nb c#d #e\n#";
        let mut found = Vec::new();
        for mut statement in statements(text) {
            let mut words = vec![statement.line.to_string()];
            while statement.has_more() {
                words.push(String::from_utf8_lossy(statement.word().unwrap()).into_owned());
            }
            found.push(words.join(" "));
        }
        assert_eq!(found, ["3 a 1 2", "5 b c#d"]);
    }

    #[test]
    fn what_is_wrong_is_said_with_the_word() {
        let check = |text: &str, read: fn(&mut Statement<'_>) -> Placeless<()>, words: &str| {
            let mut statement = statements(text.as_bytes()).next().unwrap();
            statement.usage = "a b c";
            let message = read(&mut statement).unwrap_err();
            assert!(message.contains(words), "{message}");
        };
        check("1 2", |s| s.vector().map(drop), "ends too early; expected a b c");
        check("1 2 x3", |s| s.vector().map(drop), "\"x3\" where a finite number is expected: a b c");
        check("1 2 nan", |s| s.vector().map(drop), "\"nan\"");
        check("0 0 0", |s| s.direction().map(drop), "no direction");
        check("-0.5", |s| s.share().map(drop), "-0.5");
        check("1e300", |s| s.share().map(drop), "a number up to 3.4e38");
        check("-1", |s| s.share().map(drop), "a number from 0 up");
        check("1.5", |s| s.whole().map(drop), "\"1.5\" where a whole number");
        check("0 1", |s| s.picture_size().map(drop), "0 x 1 pixels");
        check("180", |s| s.angle_of_view().map(drop), "below 180");
        check("x", |s| s.end(), "\"x\" is one word too many");
    }
}
