//! Elements of any size: byte by byte as differences from the element before, in groups of 16 that have as many bits as they need.

use super::stream::Stream;
use crate::io::Placeless;

const HEADER: u8 = 0xa0;
/// Elements whose differences share their number of bits.
const GROUP: usize = 16;

/// `count` elements of `stride` bytes, a multiple of 4 up to 256.
pub(super) fn decode(source: &[u8], count: usize, stride: usize) -> Placeless<Vec<u8>> {
    let (mut stream, tail) = Stream::open(source, HEADER, stride.max(32))?;
    let mut last = tail[tail.len() - stride..].to_vec();
    let mut out = vec![0; count * stride];
    let block = ((8192 / stride) & !(GROUP - 1)).min(256);
    for elements in out.chunks_mut(block * stride) {
        let groups = (elements.len() / stride).div_ceil(GROUP);
        for (byte, last) in last.iter_mut().enumerate() {
            let modes = stream.bytes(groups.div_ceil(4))?;
            for (group, elements) in elements.chunks_mut(GROUP * stride).enumerate() {
                let mode = modes[group / 4] >> (2 * (group % 4)) & 3;
                let codes = codes(&mut stream, mode)?;
                for (element, code) in elements.chunks_exact_mut(stride).zip(codes) {
                    *last = last.wrapping_add((code >> 1) ^ (code & 1).wrapping_neg());
                    element[byte] = *last;
                }
            }
        }
    }
    stream.finish()?;
    Ok(out)
}

/// The codes of a group. Those that do not fit into the mode's bits follow as bytes.
fn codes(stream: &mut Stream<'_>, mode: u8) -> Placeless<[u8; GROUP]> {
    let mut codes = [0; GROUP];
    let bits = match mode {
        0 => return Ok(codes),
        1 => 2,
        2 => 4,
        _ => {
            codes.copy_from_slice(stream.bytes(GROUP)?);
            return Ok(codes);
        }
    };
    let (all_ones, a_byte) = ((1 << bits) - 1, 8 / bits);
    let packed = stream.bytes(GROUP / a_byte)?;
    for (i, code) in codes.iter_mut().enumerate() {
        // The first is in the highest bits.
        let shift = 8 - bits * (i % a_byte + 1);
        *code = packed[i / a_byte] >> shift & all_ones;
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
        let decoded = codes(&mut stream, 2).expect("it is whole").map(|c| ((c >> 1) ^ (c & 1).wrapping_neg()) as i8);
        assert_eq!(decoded, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
        stream.finish().expect("nothing is left");
    }
}
