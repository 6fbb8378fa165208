//! Kinds of light paths, in Heckbert's notation (1990, *Adaptive radiosity textures for bidirectional ray tracing*): L
//! D E is light that was scattered once, diffusely, before it came to the eye.
//!
//! | symbol | means |
//! | --- | --- |
//! | `L`, `E` | the light, always first; the eye, always last |
//! | `D` | scattered diffusely: Lambert's lobe |
//! | `S` | reflected specularly: mirrored, sharp or glossy, or a highlight |
//! | `T` | transmitted: refracted, or passed through a pane |
//! | `.`, `[DS]` | any of the three; any of these |
//! | `x*`, `x+`, <code>x?</code> | any number of times, once or more, once at most |
//! | <code>x\|y</code>, `(x)` | either; a group |
//!
//! Paths are found from the eye to the light, so that expressions are read backwards. Of each the positions of its
//! letters are the states of an automaton (Glushkov 1961, *The abstract theory of automata*), and all expressions of a
//! render are made one automaton without choices, so that following a path costs one look into a table however many
//! they are.

use std::collections::BTreeMap;

/// What a surface did with light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) enum Event {
    /// Scattered by Lambert's lobe.
    Diffuse,
    /// Mirrored, or a highlight.
    Specular,
    /// Let through.
    Transmitted,
}

impl Event {
    pub(super) const ALL: [Self; 3] = [Self::Diffuse, Self::Specular, Self::Transmitted];
}

/// Most letters of an expression: a set of them is the bits of a number, of which one more stands for the eye.
const MAX_LETTERS: usize = 60;
/// The eye, in sets of positions.
const EYE: u64 = 1 << 63;

/// An expression that was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Expression {
    text: String,
    /// Which of the three events each letter stands for, as bits.
    letters: Vec<u8>,
    /// For each letter those that may stand before it.
    before: Vec<u64>,
    /// Letters that may come first, next to the light.
    first: u64,
    /// Letters that may come last, next to the eye.
    last: u64,
    /// Whether light may come straight from the light to the eye.
    empty: bool,
}

impl Expression {
    /// Reads one. Spaces mean nothing.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn new(text: &str) -> Result<Self, String> {
        let text: String = text.chars().filter(|c| !c.is_whitespace()).collect();
        let inner = text.strip_prefix('L').and_then(|rest| rest.strip_suffix('E'));
        let inner =
            inner.ok_or_else(|| format!("{text:?}: a path begins with L and ends with E, as in LDE or L.*SE"))?;
        let mut reader = Reader { rest: inner, depth: 0, letters: Vec::new(), before: Vec::new() };
        let whole = reader.either().map_err(|what| format!("{text:?}: {what}"))?;
        if let Some(c) = reader.rest.chars().next() {
            return Err(format!("{text:?}: {c:?} closes nothing"));
        }
        let Reader { letters, before, .. } = reader;
        Ok(Self { letters, before, first: whole.first, last: whole.last, empty: whole.empty, text })
    }

    /// As it was written, without spaces.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The positions after an event, before which the path was at `positions`.
    fn step(&self, positions: u64, event: usize) -> u64 {
        let from_eye = if positions & EYE != 0 { self.last } else { 0 };
        let reached = self.set(positions).fold(from_eye, |reached, at| reached | self.before[at]);
        self.set(reached).filter(|&at| self.letters[at] >> event & 1 == 1).fold(0, |set, at| set | 1 << at)
    }

    /// Whether a path that has come to `positions` is one of these if it ends at a light.
    fn ends(&self, positions: u64) -> bool {
        positions & self.first != 0 || positions & EYE != 0 && self.empty
    }

    fn set(&self, positions: u64) -> impl Iterator<Item = usize> {
        (0..self.letters.len()).filter(move |at| positions >> at & 1 == 1)
    }
}

/// What a part of an expression matches.
#[derive(Clone, Copy)]
struct Piece {
    empty: bool,
    first: u64,
    last: u64,
}

struct Reader<'t> {
    rest: &'t str,
    /// How many ( are open.
    depth: usize,
    letters: Vec<u8>,
    before: Vec<u64>,
}

impl Reader<'_> {
    /// Pieces with bars between.
    fn either(&mut self) -> Result<Piece, String> {
        let mut all = self.sequence()?;
        while self.take('|') {
            let next = self.sequence()?;
            all = Piece { empty: all.empty || next.empty, first: all.first | next.first, last: all.last | next.last };
        }
        Ok(all)
    }

    /// Pieces one after the other.
    fn sequence(&mut self) -> Result<Piece, String> {
        let mut all = Piece { empty: true, first: 0, last: 0 };
        while let Some(c) = self.rest.chars().next().filter(|c| !"|)".contains(*c)) {
            let next = self.repeated(c)?;
            self.join(all.last, next.first);
            all = Piece {
                empty: all.empty && next.empty,
                first: if all.empty { all.first | next.first } else { all.first },
                last: if next.empty { all.last | next.last } else { next.last },
            };
        }
        Ok(all)
    }

    fn repeated(&mut self, c: char) -> Result<Piece, String> {
        let mut piece = self.single(c)?;
        loop {
            let (empty, many) = match self.rest.chars().next() {
                Some('*') => (true, true),
                Some('+') => (false, true),
                Some('?') => (true, false),
                _ => return Ok(piece),
            };
            self.rest = &self.rest[1..];
            if many {
                self.join(piece.last, piece.first);
            }
            piece.empty |= empty;
        }
    }

    fn single(&mut self, c: char) -> Result<Piece, String> {
        self.rest = &self.rest[c.len_utf8()..];
        if c == '(' {
            if self.depth == MAX_LETTERS {
                return Err(format!("more than {MAX_LETTERS} ( within each other"));
            }
            self.depth += 1;
            let piece = self.either()?;
            self.depth -= 1;
            return if self.take(')') { Ok(piece) } else { Err("a ( that no ) closes".to_owned()) };
        }
        let events = match c {
            '.' => 0b111,
            '[' => {
                let (inside, rest) = self.rest.split_once(']').ok_or("a [ that no ] closes")?;
                self.rest = rest;
                let events = inside.chars().map(letter).collect::<Option<Vec<u8>>>().filter(|all| !all.is_empty());
                events
                    .ok_or_else(|| format!("[{inside}]: between [ and ] stand D, S and T"))?
                    .iter()
                    .fold(0, |all, event| all | event)
            }
            c => letter(c).ok_or_else(|| format!("{c:?} is none of D, S, T, . [ ] ( ) | * + ?"))?,
        };
        if self.letters.len() == MAX_LETTERS {
            return Err(format!("more than {MAX_LETTERS} letters"));
        }
        self.letters.push(events);
        self.before.push(0);
        let at = 1 << (self.letters.len() - 1);
        Ok(Piece { empty: false, first: at, last: at })
    }

    /// Each of `firsts` may follow each of `lasts`.
    fn join(&mut self, lasts: u64, firsts: u64) {
        let follows = self.before.iter_mut().enumerate().filter(|(at, _)| firsts >> at & 1 == 1);
        follows.for_each(|(_, before)| *before |= lasts);
    }

    fn take(&mut self, c: char) -> bool {
        let rest = self.rest.strip_prefix(c);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }
}

fn letter(c: char) -> Option<u8> {
    match c {
        'D' => Some(1),
        'S' => Some(2),
        'T' => Some(4),
        _ => None,
    }
}

/// All expressions of a render, followed at once from the eye. State 0 is at the eye.
#[derive(Clone, Debug)]
pub(in crate::render) struct Automaton {
    /// Where each event leads from each state.
    next: Vec<[u8; 3]>,
    /// Of which expressions a path is that ends at a light in a state.
    ends: Vec<Vec<u16>>,
}

impl Automaton {
    /// # Errors
    /// In words, where they need too many states.
    pub(super) fn new(expressions: &[&Expression]) -> Result<Self, String> {
        let start: Vec<u64> = vec![EYE; expressions.len()];
        let (mut numbers, mut states) = (BTreeMap::from([(start.clone(), 0)]), vec![start]);
        let mut next = Vec::new();
        while next.len() < states.len() {
            let state = states[next.len()].clone();
            next.push([0, 0, 0]);
            for event in Event::ALL {
                let event = event as usize;
                let after: Vec<u64> = expressions.iter().zip(&state).map(|(e, &at)| e.step(at, event)).collect();
                let new = states.len();
                let number = *numbers.entry(after.clone()).or_insert(new);
                if number == new {
                    states.push(after);
                }
                let number = u8::try_from(number).map_err(|_| "these kinds of light paths are too many to follow")?;
                if let Some(row) = next.last_mut() {
                    row[event] = number;
                }
            }
        }
        let ends = states.iter().map(|state| {
            let ends = expressions.iter().zip(state).zip(0..);
            ends.filter(|((e, at), _)| e.ends(**at)).map(|(_, number)| number).collect()
        });
        Ok(Self { ends: ends.collect(), next })
    }

    /// The state after an event.
    #[inline]
    pub(super) fn after(&self, state: u8, event: Event) -> u8 {
        self.next[state as usize][event as usize]
    }

    /// The expressions that a path is of which ends at a light.
    #[inline]
    pub(super) fn ends(&self, state: u8) -> &[u16] {
        &self.ends[state as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expressions that a path is of, which is written from the light to the eye.
    fn of(automaton: &Automaton, path: &str) -> Vec<u16> {
        let events = path.chars().rev().map(|c| match c {
            'D' => Event::Diffuse,
            'S' => Event::Specular,
            _ => Event::Transmitted,
        });
        automaton.ends(events.fold(0, |state, event| automaton.after(state, event))).to_vec()
    }

    #[test]
    fn paths_are_told_apart() {
        let texts = ["LE", "LDE", "L S* D E", "L.+DE", "L(D|ST)+[DT]E", "LD?S+.E", "L.*E"];
        let expressions: Vec<_> = texts.iter().map(|text| Expression::new(text).unwrap()).collect();
        let automaton = Automaton::new(&expressions.iter().collect::<Vec<_>>()).unwrap();
        for (path, expected) in [
            ("", vec![0, 6]),
            ("D", vec![1, 2, 6]),
            ("S", vec![6]),
            ("SD", vec![2, 3, 6, 5]),
            ("SSD", vec![2, 3, 5, 6]),
            ("DS", vec![6]),
            ("DD", vec![3, 4, 6]),
            ("STT", vec![4, 6]),
            ("DSTD", vec![3, 4, 6]),
            ("DSST", vec![5, 6]),
            ("TSD", vec![3, 6]),
        ] {
            let mut expected = expected;
            expected.sort_unstable();
            assert_eq!(of(&automaton, path), expected, "{path}");
        }
        assert_eq!(expressions[2].text(), "LS*DE");
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (text, words) in [
            ("", "begins with L"),
            ("DE", "begins with L"),
            ("LD", "begins with L"),
            ("LXE", "'X' is none of"),
            ("L(DE", "no ) closes"),
            ("LD)E", "closes nothing"),
            ("L[DE", "no ] closes"),
            ("L[]E", "between [ and ]"),
            ("L[DL]E", "between [ and ]"),
            ("L*E", "'*' is none of"),
        ] {
            let error = Expression::new(text).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
        assert!(Expression::new(&format!("L{}E", "D".repeat(61))).unwrap_err().contains("more than 60"));
        for deep in ["(".repeat(100_000), format!("{}D{}", "(".repeat(61), ")".repeat(61))] {
            assert!(Expression::new(&format!("L{deep}E")).unwrap_err().contains("within each other"));
        }
        assert!(Expression::new(&format!("L{}D{}{}E", "(".repeat(60), ")".repeat(60), "(D)".repeat(59))).is_ok());
        let long = Expression::new(&format!("L.*D{}E", ".".repeat(12))).unwrap();
        assert!(Automaton::new(&[&long]).is_ok(), "backwards it has few states");
        let long = Expression::new(&format!("L{}D.*E", ".".repeat(12))).unwrap();
        assert!(Automaton::new(&[&long]).unwrap_err().contains("too many"));
    }
}
