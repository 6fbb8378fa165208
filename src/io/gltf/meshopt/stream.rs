//! Reading a compressed stream from its front, up to a tail of known size.

use crate::io::Placeless;

/// What is left of a stream.
pub(super) struct Stream<'a>(&'a [u8]);

impl<'a> Stream<'a> {
    /// The stream without its header byte and its tail, and the tail.
    ///
    /// # Errors
    /// Where the header is another, or the stream is shorter than both.
    pub(super) fn open(source: &'a [u8], header: u8, tail: usize) -> Placeless<(Self, &'a [u8])> {
        match source.split_first() {
            Some((&first, rest)) if first == header && rest.len() >= tail => {
                let (body, tail) = rest.split_at(rest.len() - tail);
                Ok((Self(body), tail))
            }
            Some((&first, _)) if first != header => {
                Err(format!("the stream begins with byte {first:#04x}, where {header:#04x} belongs"))
            }
            _ => Err(truncated()),
        }
    }

    pub(super) fn bytes(&mut self, count: usize) -> Placeless<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count).ok_or_else(truncated)?;
        self.0 = rest;
        Ok(bytes)
    }

    pub(super) fn byte(&mut self) -> Placeless<u8> {
        self.bytes(1).map(|bytes| bytes[0])
    }

    /// A number in sevens of bits, the lowest first (unsigned LEB128).
    pub(super) fn number(&mut self) -> Placeless<u32> {
        let mut number = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            // Bits past the 32nd are none of the number's.
            number |= u32::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err("a number in the stream has more than 32 bits".into())
    }

    /// An error unless all was read.
    pub(super) fn finish(&self) -> Placeless<()> {
        if self.0.is_empty() { Ok(()) } else { Err(format!("{} bytes of the stream are left over", self.0.len())) }
    }
}

fn truncated() -> String {
    "the stream ends too early".into()
}

/// A difference from its zigzag code.
pub(super) fn zigzag(code: u32) -> u32 {
    (code >> 1) ^ (code & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_in_sevens_of_bits() {
        let (mut stream, tail) =
            Stream::open(&[9, 0x7f, 0x81, 0x04, 0xff, 0xa0, 0x05, 0xff, 1, 2], 9, 2).expect("it is whole");
        assert_eq!(tail, [1, 2]);
        assert_eq!([(); 3].map(|()| stream.number()), [Ok(0x7f), Ok(0x201), Ok(0x7f + (0x20 << 7) + (5 << 14))]);
        assert!(stream.number().is_err_and(|message| message.contains("too early")));
        assert!(Stream::open(&[8, 1, 2], 9, 2).is_err() && Stream::open(&[9, 1], 9, 2).is_err());
    }

    #[test]
    fn differences_take_turns() {
        assert_eq!([0, 1, 2, 3, u32::MAX].map(|code| zigzag(code) as i32), [0, -1, 1, -2, i32::MIN]);
    }
}
