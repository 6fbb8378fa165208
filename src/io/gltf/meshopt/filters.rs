//! What elements pass through after they are decoded, in place. Values that no encoder writes give some value.

use std::f32::consts::FRAC_1_SQRT_2;

/// Unit vectors from two coordinates on an octahedron, as normalised bytes (stride 4) or 16-bit numbers (stride 8); the
/// fourth component stays.
pub(super) fn octahedral(bytes: &mut [u8], stride: usize) {
    if stride == 4 {
        for v in bytes.as_chunks_mut::<4>().0 {
            let unit = from_octahedron([0, 1, 2].map(|k| f32::from(v[k] as i8)));
            (0..3).for_each(|k| v[k] = (unit[k] * 127.0).round() as i8 as u8);
        }
        return;
    }
    for v in bytes.as_chunks_mut::<8>().0 {
        let unit = from_octahedron([0, 1, 2].map(|k| f32::from(word(v, k))));
        (0..3).for_each(|k| set_word(v, k, (unit[k] * 32_767.0).round() as i16 as u16));
    }
}

/// The third number is what stands for 1.
fn from_octahedron([x, y, one]: [f32; 3]) -> [f32; 3] {
    let (x, y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    let below = z.min(0.0);
    let (x, y) = (x - below.copysign(x), y - below.copysign(y));
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

/// Unit quaternions from all components but the largest, which the lowest two bits of the fourth number name; the
/// others of its bits stand for 1.
pub(super) fn quaternion(bytes: &mut [u8]) {
    for q in bytes.as_chunks_mut::<8>().0 {
        let last = word(q, 3);
        let one = f32::from(last | 3);
        let [x, y, z] = [0, 1, 2].map(|k| f32::from(word(q, k)) / one * FRAC_1_SQRT_2);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let largest = (last & 3) as usize;
        for (k, value) in [(1, x), (2, y), (3, z), (0, w)] {
            set_word(q, (largest + k) % 4, (value * 32_767.0).round() as i16 as u16);
        }
    }
}

/// Colours and alpha from brightness and two differences of colours (YCoCg; Malvar, Sullivan and Srinivasan
/// 2008, *Lifting-based reversible color transformations for image compression*), as bytes (stride 4) or 16-bit numbers
/// (stride 8). The highest bit of the fourth number that is set says how many bits each has, and what is below it is
/// alpha, of one bit less.
pub(super) fn color(bytes: &mut [u8], stride: usize) {
    if stride == 4 {
        for v in bytes.as_chunks_mut::<4>().0 {
            let color = from_ycocg([v[0].into(), (v[1] as i8).into(), (v[2] as i8).into(), v[3].into()], 255.0);
            *v = color.map(|value| value as u8);
        }
        return;
    }
    for v in bytes.as_chunks_mut::<8>().0 {
        let [y, co, cg, alpha] = [0, 1, 2, 3].map(|k| word(v, k));
        let color = from_ycocg([(y as u16).into(), co.into(), cg.into(), (alpha as u16).into()], 65_535.0);
        for (k, value) in color.into_iter().enumerate() {
            set_word(v, k, value as u16);
        }
    }
}

/// Whole numbers up to `most`, where the file is sound.
fn from_ycocg([y, co, cg, alpha]: [i32; 4], most: f32) -> [f32; 4] {
    let one = (1 << (32 - alpha.leading_zeros())) - 1;
    let alpha = alpha & one >> 1;
    let channels = [y + co - cg, y + cg, y - co - cg, alpha << 1 | alpha & 1];
    channels.map(|channel| (channel as f32 * (most / one as f32)).round())
}

/// Floats from a mantissa of 24 bits and an exponent of 8.
pub(super) fn exponential(bytes: &mut [u8]) {
    for float in bytes.as_chunks_mut::<4>().0 {
        let code = i32::from_le_bytes(*float);
        let (exponent, mantissa) = (code >> 24, code << 8 >> 8);
        *float = libm::ldexpf(mantissa as f32, exponent).to_le_bytes();
    }
}

fn word(bytes: &[u8; 8], k: usize) -> i16 {
    i16::from_le_bytes([bytes[2 * k], bytes[2 * k + 1]])
}

fn set_word(bytes: &mut [u8; 8], k: usize, value: u16) {
    bytes[2 * k..2 * k + 2].copy_from_slice(&value.to_le_bytes());
}
