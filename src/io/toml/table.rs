//! Typed access to a TOML document that knows where everything stands.
//!
//! A table remembers which keys it was asked for, and [`Table::finish`] refuses all others: so the code that reads a
//! table is its schema, and what it does not know it can suggest. Deserialising into structs, the alternative, loses
//! the place of most mistakes, and what serde says about them names neither the remedy nor the nearest key.

use std::ops::RangeInclusive;

use ::toml::de::{DeTable, DeValue};

use crate::io::suggest::{is_slip, suggestion};
use crate::io::text::{excerpt, quoted};
use crate::math::{DVec3, Vec3};

/// What is wrong, and where in the text.
#[derive(Debug)]
pub(super) struct Fault {
    /// Offset in bytes.
    pub(super) at: usize,
    pub(super) message: String,
}

/// A result with a place for its error.
pub(super) type Read<T> = Result<T, Fault>;

/// A table that is being read.
pub(super) struct Table<'t> {
    entries: &'t DeTable<'t>,
    at: usize,
    /// As messages call it: `[[sphere]]`.
    name: String,
    asked: Vec<&'static str>,
}

/// A value, and the key it belongs to.
#[derive(Clone, Copy)]
pub(super) struct Value<'t> {
    value: &'t DeValue<'t>,
    key: &'t str,
    pub(super) at: usize,
}

impl<'t> Table<'t> {
    pub(super) fn new(entries: &'t DeTable<'t>, at: usize, name: impl Into<String>) -> Self {
        Self { entries, at, name: name.into(), asked: Vec::new() }
    }

    /// The value of a key, if it is there.
    pub(super) fn get(&mut self, key: &'static str) -> Option<Value<'t>> {
        if !self.asked.contains(&key) {
            self.asked.push(key);
        }
        let (_, value) = self.entries.get_key_value(key)?;
        Some(Value { value: value.get_ref(), key, at: value.span().start })
    }

    /// The value of a key that must be there.
    pub(super) fn need(&mut self, key: &'static str) -> Read<Value<'t>> {
        let found = self.get(key);
        let lacks = || self.fault(format!("{} lacks {key:?}", self.name));
        found.ok_or_else(|| self.misspelt(key).unwrap_or_else(lacks))
    }

    /// That a key stands there which nobody has asked for so far, and which is `key` with a slip. Not as far from it as
    /// a [`suggestion`] may be: it may be asked for later, as `apex_radius` after `base_radius`.
    fn misspelt(&self, key: &str) -> Option<Fault> {
        let mut others = self.entries.keys().filter(|other| !self.asked.contains(&other.get_ref().as_ref()));
        others.find_map(|other| {
            let word = other.get_ref().as_ref();
            let message = || format!("{} has no key {}; did you mean {key:?}?", self.name, quoted(word.as_bytes()));
            is_slip(word, key).then(|| Fault { at: other.span().start, message: message() })
        })
    }

    /// The value of a key as `read` has it, if it is there.
    pub(super) fn optional<T>(
        &mut self,
        key: &'static str,
        read: impl FnOnce(Value<'t>) -> Read<T>,
    ) -> Read<Option<T>> {
        self.get(key).map(read).transpose()
    }

    /// Refuses a key that belongs to something else, if it is there; it is not among those that the table knows.
    pub(super) fn refuse(&self, key: &'static str, why: &str) -> Read<()> {
        match self.entries.get_key_value(key) {
            Some((_, value)) => Err(Fault { at: value.span().start, message: format!("{key:?} {why}") }),
            None => Ok(()),
        }
    }

    /// The tables of `[[key]]`, in order; none where there are none.
    pub(super) fn tables(&mut self, key: &'static str) -> Read<Vec<Table<'t>>> {
        let Some(value) = self.get(key) else { return Ok(Vec::new()) };
        if let DeValue::Table(_) = value.value {
            return Err(value.fault(format!("one table [{key}] where there may be several; write [[{key}]]")));
        }
        value.items()?.map(|item| item.table(format!("[[{key}]]"))).collect()
    }

    /// The tables of `[key.NAME]` with their names.
    pub(super) fn named_tables(&mut self, key: &'static str) -> Read<Vec<(&'t str, Table<'t>)>> {
        let Some(value) = self.get(key) else { return Ok(Vec::new()) };
        let DeValue::Table(entries) = value.value else {
            return Err(value.fault(format!("{key:?} where tables [{key}.NAME] are expected")));
        };
        let named = entries.iter().map(|(name, value)| {
            let value = Value { value: value.get_ref(), key, at: value.span().start };
            Ok((name.get_ref().as_ref(), value.table(format!("[{key}.{}]", name.get_ref()))?))
        });
        named.collect()
    }

    /// Refuses keys that nobody asked for.
    pub(super) fn finish(self) -> Read<()> {
        let unknown = self.entries.iter().find(|(key, _)| !self.asked.contains(&key.get_ref().as_ref()));
        let Some((key, _)) = unknown else { return Ok(()) };
        let word = key.get_ref().as_ref();
        let near = suggestion(word, self.asked.iter().copied());
        let known = if near.is_empty() { format!("; it knows {}", self.asked.join(", ")) } else { near };
        let message = format!("{} has no key {}{known}", self.name, quoted(word.as_bytes()));
        Err(Fault { at: key.span().start, message })
    }

    /// Something that is wrong with the table as a whole.
    pub(super) fn fault(&self, message: impl Into<String>) -> Fault {
        Fault { at: self.at, message: message.into() }
    }

    /// Where it stands.
    pub(super) fn at(&self) -> usize {
        self.at
    }
}

impl<'t> Value<'t> {
    pub(super) fn fault(self, message: impl Into<String>) -> Fault {
        Fault { at: self.at, message: message.into() }
    }

    /// Something else was expected.
    pub(super) fn unlike(self, expected: &str) -> Fault {
        self.fault(format!("{} where {:?} wants {expected}", shown(self.value), self.key))
    }

    /// A finite number.
    pub(super) fn number(self) -> Read<f64> {
        let number = match self.value {
            // Whole numbers may be larger than 64 bits hold.
            DeValue::Integer(number) if number.radix() == 10 => number.as_str().parse().ok(),
            DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok().map(|n| n as f64),
            DeValue::Float(number) => number.as_str().parse().ok(),
            _ => None,
        };
        number.filter(|x| x.is_finite()).ok_or_else(|| self.unlike("a finite number"))
    }

    /// A number from 0 up, in single precision.
    pub(super) fn share(self) -> Read<f32> {
        let number = self.number()?;
        let share = number as f32;
        match number >= 0.0 {
            true if share.is_finite() => Ok(share),
            true => Err(self.unlike("a number up to 3.4e38")),
            false => Err(self.unlike("a number from 0 up")),
        }
    }

    /// A list of `N` finite numbers.
    pub(super) fn numbers<const N: usize>(self) -> Read<[f64; N]> {
        let expected = || self.unlike(&format!("a list of {N} numbers"));
        let items = self.list().ok_or_else(expected)?;
        let numbers = items.map(Value::number).collect::<Read<Vec<f64>>>()?;
        numbers.try_into().map_err(|_| expected())
    }

    pub(super) fn vector(self) -> Read<DVec3> {
        self.numbers().map(DVec3::from_array)
    }

    /// A vector of length 1 that points where the list does.
    pub(super) fn direction(self) -> Read<DVec3> {
        self.vector()?.try_normalize().ok_or_else(|| self.unlike("a direction, not all 0"))
    }

    /// A linear colour from 0 up: three numbers, or one for grey.
    pub(super) fn color(self) -> Read<Vec3> {
        if !matches!(self.value, DeValue::Array(_)) {
            return self.share().map(Vec3::splat).map_err(|_| self.unlike("a colour: three numbers from 0 up, or one"));
        }
        let color = self.vector()?.as_vec3();
        let good = color.is_finite() && color.min_element() >= 0.0;
        if good { Ok(color) } else { Err(self.fault(format!("{:?} wants numbers from 0 up", self.key))) }
    }

    pub(super) fn text(self) -> Read<&'t str> {
        self.value.as_str().ok_or_else(|| self.unlike("a text in quotes"))
    }

    pub(super) fn flag(self) -> Read<bool> {
        self.value.as_bool().ok_or_else(|| self.unlike("true or false"))
    }

    /// A whole number within a range.
    pub(super) fn whole(self, range: RangeInclusive<u64>) -> Read<u64> {
        let number = match self.value {
            DeValue::Integer(number) => u64::from_str_radix(number.as_str(), number.radix()).ok(),
            _ => None,
        };
        let (first, last) = (*range.start(), *range.end());
        let inside = number.filter(|number| range.contains(number));
        inside.ok_or_else(|| self.unlike(&format!("a whole number from {first} to {last}")))
    }

    /// One of several words, as what it stands for.
    pub(super) fn choice<T: Copy>(self, choices: &[(&str, T)]) -> Read<T> {
        let text = self.text()?;
        let found = choices.iter().find(|(word, _)| *word == text);
        found.map(|(_, meaning)| *meaning).ok_or_else(|| {
            let words: Vec<_> = choices.iter().map(|(word, _)| format!("{word:?}")).collect();
            let near = suggestion(text, choices.iter().map(|(word, _)| *word));
            self.fault(format!("{} where {:?} wants {}{near}", quoted(text.as_bytes()), self.key, words.join(", ")))
        })
    }

    /// One of these, by its name.
    pub(super) fn one_of<T: Copy, const N: usize>(self, all: [T; N], name: fn(T) -> &'static str) -> Read<T> {
        self.choice(&all.map(|value| (name(value), value)))
    }

    fn list(self) -> Option<impl Iterator<Item = Value<'t>>> {
        let key = self.key;
        let item =
            move |item: &'t ::toml::Spanned<DeValue<'t>>| Value { value: item.get_ref(), key, at: item.span().start };
        self.value.as_array().map(|items| items.iter().map(item))
    }

    /// The values of a list.
    pub(super) fn items(self) -> Read<impl Iterator<Item = Value<'t>>> {
        self.list().ok_or_else(|| self.unlike("a list"))
    }

    /// The value as a table that messages call `name`.
    pub(super) fn table(self, name: String) -> Read<Table<'t>> {
        match self.value {
            DeValue::Table(entries) => Ok(Table::new(entries, self.at, name)),
            DeValue::Array(items) if items.iter().all(|item| item.get_ref().is_table()) && !name.starts_with("[[") => {
                Err(self.fault(format!("several tables [{name}] where there is one; write {name}")))
            }
            _ => Err(self.unlike("a table")),
        }
    }

    pub(super) fn is_list(self) -> bool {
        self.value.is_array()
    }
}

/// A value as messages show it: what is a text and what is a number can be told apart, and of a list that is short what
/// is in it is seen.
fn shown(value: &DeValue<'_>) -> String {
    const SHORT: usize = 5;
    match value {
        DeValue::String(text) => format!("the text {}", quoted(text.as_bytes())),
        // With its radix.
        DeValue::Integer(number) => excerpt(number.to_string().as_bytes()),
        DeValue::Float(number) => excerpt(number.as_str().as_bytes()),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(items) if items.len() <= SHORT && !items.iter().any(|item| item.get_ref().is_table()) => {
            let items: Vec<String> = items.iter().map(|item| within(item.get_ref())).collect();
            format!("[{}]", items.join(", "))
        }
        DeValue::Array(items) => format!("a list of {}", items.len()),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// The same of what is in a list.
fn within(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => quoted(text.as_bytes()),
        DeValue::Array(_) => "[...]".to_owned(),
        other => shown(other),
    }
}
