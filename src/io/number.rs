//! Numbers as they stand in text files.
//!
//! Nearly all have so few digits that one division of two numbers without an error gives the one nearest to them
//! (Clinger 1990, *How to read floating point numbers accurately*). The standard library does the same, but is told
//! where a word ends, and that it is UTF-8, for which each byte has been read twice before.

use std::str::FromStr;

/// What a word may be read as.
pub(super) trait Number: FromStr {
    /// The number that a text begins with, whatever comes after it, and how many bytes it is long; the same as
    /// [`FromStr`] makes of these bytes. None where that is not sure at once.
    fn leading(_text: &[u8]) -> Option<(Self, usize)> {
        None
    }
}

impl Number for i32 {}
impl Number for i64 {}
impl Number for u32 {}
impl Number for u64 {}

macro_rules! floats {
    ($($float:ident $powers:expr)*) => {$(
        impl Number for $float {
            #[inline]
            fn leading(text: &[u8]) -> Option<(Self, usize)> {
                // Those that it holds without an error.
                const POWERS: &[$float] = &$powers;
                let decimal = Decimal::leading(text)?;
                let digits = Some(decimal.digits).filter(|&digits| digits <= 1 << Self::MANTISSA_DIGITS)? as Self;
                let power = *POWERS.get(decimal.exponent.unsigned_abs())?;
                let size = if decimal.exponent < 0 { digits / power } else { digits * power };
                Some((if decimal.is_negative { -size } else { size }, decimal.length))
            }
        }
    )*};
}

floats! {
    f32 [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10]
    f64 [
        1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
        1e21, 1e22,
    ]
}

/// `digits` times ten to the `exponent`.
struct Decimal {
    is_negative: bool,
    digits: u64,
    exponent: isize,
    /// In bytes.
    length: usize,
}

impl Decimal {
    /// The one that a text begins with; none of more digits than are sure to fit.
    #[inline]
    fn leading(text: &[u8]) -> Option<Self> {
        let sign = sign(text);
        let (digits, whole) = whole(&text[sign..], 0);
        let mut length = sign + whole;
        let (digits, fraction) = match text.get(length) {
            Some(b'.') => {
                length += 1;
                self::whole(&text[length..], digits)
            }
            _ => (digits, 0),
        };
        length += fraction;
        if !(1..=MAX_DIGITS).contains(&(whole + fraction)) {
            return None;
        }
        let mut exponent = -(fraction as isize);
        if let Some(b'e' | b'E') = text.get(length) {
            let power = &text[length + 1..];
            let sign = self::sign(power);
            let (digits, count) = self::whole(&power[sign..], 0);
            if !(1..=4).contains(&count) {
                return None;
            }
            exponent += if power[0] == b'-' { -(digits as isize) } else { digits as isize };
            length += 1 + sign + count;
        }
        Some(Self { is_negative: text[0] == b'-', digits, exponent, length })
    }
}

/// So many fit into 64 bits, whatever they are.
const MAX_DIGITS: usize = 19;

/// The length of a sign that a text may begin with.
#[inline]
fn sign(text: &[u8]) -> usize {
    usize::from(matches!(text.first(), Some(b'+' | b'-')))
}

/// Digits that a text begins with, after those that came `before`, and how many they are; of too many, what is left of
/// them in 64 bits.
#[inline]
pub(super) fn whole(text: &[u8], before: u64) -> (u64, usize) {
    let (mut digits, mut count) = (before, 0);
    for &byte in text {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            break;
        }
        digits = digits.wrapping_mul(10).wrapping_add(digit.into());
        count += 1;
    }
    (digits, count)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Reads `text` as the library does, or not at all.
    fn check<T: Number + Copy + Into<f64>>(text: &str, followed_by: &str) -> bool {
        let joined = format!("{text}{followed_by}");
        let Some((value, length)) = T::leading(joined.as_bytes()) else { return false };
        let expected: f64 = joined[..length].parse::<T>().ok().expect("a number").into();
        let value: f64 = value.into();
        assert_eq!(value.to_bits(), expected.to_bits(), "{joined}: {value} for {expected}");
        // After an e, a sign and digits are the same number's.
        let goes_on = text.ends_with(['e', 'E']) && followed_by.starts_with('-');
        assert!(length <= text.len() || goes_on, "{joined}: {length} bytes of {text:?}");
        length == text.len()
    }

    proptest! {
        #[test]
        fn what_is_read_at_once_is_what_the_library_reads(
            text in r"[+-]?[0-9]{0,12}(\.[0-9]{0,12})?([eE][+-]?[0-9]{0,5})?",
            followed_by in r"([ /x\n,-].{0,3})?",
        ) {
            check::<f64>(&text, &followed_by);
            check::<f32>(&text, &followed_by);
        }

        #[test]
        fn a_number_as_programs_write_it_is_read_at_once(value in -1e6..1e6_f64, places in 0..9_usize) {
            let (plain, scaled) = (format!("{value:.places$}"), format!("{value:.places$e}"));
            let short = format!("{:.*}", places.min(4), value / 1e4);
            prop_assert!(check::<f64>(&plain, " ") && check::<f64>(&scaled, "\n") && check::<f32>(&short, ""));
        }
    }

    #[test]
    fn what_is_not_sure_is_left_to_the_library() {
        for text in [
            "",
            "-",
            ".",
            "+.",
            "-.e5",
            "e5",
            "x",
            "nan",
            "inf",
            "1e",
            "1e+",
            "1e99999",
            "1e23",
            "1e-23",
            "12345678901234567890",
            // What is left of it in 64 bits is 1.
            "18446744073709551617",
        ] {
            assert!(f64::leading(text.as_bytes()).is_none(), "{text}");
        }
        // Halfway between two, and beyond what f32 holds.
        assert!(f64::leading(b"9007199254740993").is_none());
        assert!(f32::leading(b"16777217").is_none() && f32::leading(b"1e11").is_none());
        assert_eq!(f64::leading(b"9007199254740992"), Some((9_007_199_254_740_992.0, 16)));
        for (text, value, length) in
            [("-0 1", -0.0, 2), ("5.", 5.0, 2), (".5/3", 0.5, 2), ("+1.5E+2x", 150.0, 7), ("1.2.3", 1.2, 3)]
        {
            let (read, bytes) = f64::leading(text.as_bytes()).expect(text);
            assert_eq!((read.to_bits(), bytes), (f64::to_bits(value), length), "{text}");
        }
    }
}
