//! Elements of any size: byte by byte as differences from the element before, in groups of 16 that have as many bits as
//! they need.
//!
//! The first version of the stream has differences of bytes alone, and what `KHR_meshopt_compression` adds is the
//! second: four bytes at a time are a [channel](Channel), of which differences may be wider; and each byte's groups
//! have a choice of widths of its own.

use super::stream::{Stream, zigzag};
use crate::io::Placeless;

const HEADER: u8 = 0xa0;
const SECOND_HEADER: u8 = 0xa1;
/// Elements whose differences share their number of bits.
const GROUP: usize = 16;
/// Elements of a block, at most: their bytes are stored one after the other.
const BLOCK: usize = 256;
/// Bytes of a channel.
const CHANNEL: usize = 4;

/// What four bytes of an element are the difference from those of the one before of.
#[derive(Clone, Copy)]
enum Channel {
    /// Each of its own.
    Bytes,
    /// Two numbers of 16 bits.
    Words,
    /// The bits of one number of 32 that differ, turned to the left by so many.
    Bits(u32),
}

/// How the codes of one byte of all elements of a block are stored.
enum Packing {
    /// In groups, each of which names one of four numbers of bits a code.
    Groups([u8; 4]),
    /// All are 0.
    Zeros,
    /// As they are.
    Plain,
}

/// `count` elements of `stride` bytes, a multiple of 4 up to 256.
pub(super) fn decode(source: &[u8], count: usize, stride: usize) -> Placeless<Vec<u8>> {
    let channel_count = stride / CHANNEL;
    let is_second = source.first() == Some(&SECOND_HEADER);
    let (mut stream, baseline, channels) = if is_second {
        let (stream, tail) = Stream::open(source, SECOND_HEADER, (stride + channel_count).max(24))?;
        let (baseline, modes) = tail.split_at(tail.len() - channel_count);
        (stream, baseline, modes.iter().copied().map(Channel::of).collect::<Placeless<Vec<_>>>()?)
    } else {
        let (stream, tail) = Stream::open(source, HEADER, stride.max(32))?;
        (stream, tail, vec![Channel::Bytes; channel_count])
    };
    let mut last = baseline[baseline.len() - stride..].to_vec();
    let mut out = vec![0; count * stride];
    let block = ((8192 / stride) & !(GROUP - 1)).min(BLOCK);
    let mut codes = [[0; BLOCK]; CHANNEL];
    for elements in out.chunks_mut(block * stride) {
        let count = elements.len() / stride;
        let packings = if is_second { Some(stream.bytes(channels.len())?) } else { None };
        for (k, (channel, last)) in channels.iter().zip(last.as_chunks_mut::<CHANNEL>().0).enumerate() {
            for (byte, codes) in codes.iter_mut().enumerate() {
                let packing = packings.map_or(Packing::FIRST, |packings| Packing::of(packings[k] >> (2 * byte) & 3));
                packing.read(&mut stream, &mut codes[..count])?;
            }
            for (i, element) in elements.chunks_exact_mut(stride).enumerate() {
                *last = channel.next(*last, [0, 1, 2, 3].map(|byte| codes[byte][i]));
                element[k * CHANNEL..][..CHANNEL].copy_from_slice(last);
            }
        }
    }
    stream.finish()?;
    Ok(out)
}

impl Channel {
    fn of(mode: u8) -> Placeless<Self> {
        match (mode & 15, mode >> 4) {
            (0, 0) => Ok(Self::Bytes),
            (1, 0) => Ok(Self::Words),
            (2, turn) => Ok(Self::Bits(turn.into())),
            _ => Err(format!("the stream has channels of mode {mode:#04x}, which there is not")),
        }
    }

    /// What comes after `last`, of whose difference `codes` are the bytes, the lowest first.
    #[inline(always)]
    fn next(self, last: [u8; 4], codes: [u8; 4]) -> [u8; 4] {
        let of_word = |[low, high]: [u8; 2]| u16::from_le_bytes([low, high]);
        let next_word = |last, code| of_word(last).wrapping_add(zigzag(of_word(code).into()) as u16).to_le_bytes();
        match self {
            Self::Bytes => [0, 1, 2, 3].map(|k| last[k].wrapping_add(zigzag(codes[k].into()) as u8)),
            Self::Words => {
                let ([a, b, c, d], [i, j, k, l]) = (last, codes);
                let ([a, b], [c, d]) = (next_word([a, b], [i, j]), next_word([c, d], [k, l]));
                [a, b, c, d]
            }
            Self::Bits(turn) => (u32::from_le_bytes(last) ^ u32::from_le_bytes(codes).rotate_right(turn)).to_le_bytes(),
        }
    }
}

impl Packing {
    /// All that the first version has.
    const FIRST: Self = Self::Groups([0, 2, 4, 8]);

    /// The one that two bits name in the second.
    const fn of(mode: u8) -> Self {
        match mode {
            0 => Self::Groups([0, 1, 2, 4]),
            1 => Self::Groups([1, 2, 4, 8]),
            2 => Self::Zeros,
            _ => Self::Plain,
        }
    }

    /// One code for each element of the block.
    fn read(&self, stream: &mut Stream<'_>, codes: &mut [u8]) -> Placeless<()> {
        match self {
            Self::Zeros => codes.fill(0),
            Self::Plain => codes.copy_from_slice(stream.bytes(codes.len())?),
            Self::Groups(widths) => {
                let modes = stream.bytes(codes.len().div_ceil(GROUP).div_ceil(4))?;
                for (group, codes) in codes.chunks_mut(GROUP).enumerate() {
                    let mode = modes[group / 4] >> (2 * (group % 4)) & 3;
                    let whole = read_group(stream, widths[usize::from(mode)].into())?;
                    codes.copy_from_slice(&whole[..codes.len()]);
                }
            }
        }
        Ok(())
    }
}

/// The codes of a group, of `bits` each. Those that do not fit into so many follow as bytes.
fn read_group(stream: &mut Stream<'_>, bits: usize) -> Placeless<[u8; GROUP]> {
    let mut codes = [0; GROUP];
    match bits {
        0 => return Ok(codes),
        8 => {
            codes.copy_from_slice(stream.bytes(GROUP)?);
            return Ok(codes);
        }
        _ => {}
    }
    let (all_ones, a_byte) = ((1 << bits) - 1, 8 / bits);
    let packed = stream.bytes(GROUP / a_byte)?;
    for (i, code) in codes.iter_mut().enumerate() {
        // The first is in the highest bits, or in the lowest where they are single.
        let place = if bits == 1 { i % a_byte } else { a_byte - 1 - i % a_byte };
        *code = packed[i / a_byte] >> (bits * place) & all_ones;
        if *code == all_ones {
            *code = stream.byte()?;
        }
    }
    Ok(codes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_as_in_the_specification() {
        let mut bytes = vec![HEADER, 0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
        bytes.extend([0; 32]);
        let (mut stream, _) = Stream::open(&bytes, HEADER, 32).expect("it is whole");
        let decoded = read_group(&mut stream, 4).expect("it is whole").map(|code| zigzag(code.into()) as i8);
        assert_eq!(decoded, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
        stream.finish().expect("nothing is left");
    }

    #[test]
    fn channels_that_there_are_not_are_refused() {
        for mode in [3, 0x10, 0x21, 0xff] {
            assert!(Channel::of(mode).is_err_and(|message| message.contains("channels of mode")), "{mode}");
        }
        assert!(matches!(Channel::of(0xf2), Ok(Channel::Bits(15))));
    }
}
