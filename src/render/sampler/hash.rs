//! Numbers that look random, as functions of others.

/// Four hashes of four numbers (Jarzynski and Olano 2020, *Hash functions for GPU rendering*, JCGT 9(3)).
pub(crate) const fn pcg4d(v: [u32; 4]) -> [u32; 4] {
    let [x, y, z, w] = v;
    let x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let y = y.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let z = z.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let w = w.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let [x, y, z, w] = mix([x, y, z, w]);
    mix([x ^ (x >> 16), y ^ (y >> 16), z ^ (z >> 16), w ^ (w >> 16)])
}

const fn mix([x, y, z, w]: [u32; 4]) -> [u32; 4] {
    let x = x.wrapping_add(y.wrapping_mul(w));
    let y = y.wrapping_add(z.wrapping_mul(x));
    let z = z.wrapping_add(x.wrapping_mul(y));
    let w = w.wrapping_add(y.wrapping_mul(z));
    [x, y, z, w]
}
