//! Numbers to the bit: hexadecimal floats, as C17 (6.4.4.2) and printf's %a have them.
//!
//! Decimal digits that are read back the same exist for every f32, and are accepted as well; these show which bits are
//! set.

use crate::math::Vec3;
use crate::ray::Ray;

/// An f32 as text: `0x1.8p+1` is 3; `inf`, `-inf` and `nan` are themselves.
pub fn to_hex(x: f32) -> String {
    if !x.is_finite() {
        return x.to_string().to_lowercase();
    }
    let bits = x.to_bits();
    let (field, fraction) = ((bits >> 23 & 0xff) as i32, bits & 0x7f_ffff);
    let sign = if x.is_sign_negative() { "-" } else { "" };
    if field == 0 && fraction == 0 {
        return format!("{sign}0x0p+0");
    }
    // Denormals keep the exponent of the smallest normal number.
    let (lead, exponent) = if field == 0 { (0, -126) } else { (1, field - 127) };
    // 23 bits are six digits less one bit.
    let digits = format!("{:06x}", fraction << 1);
    let digits = digits.trim_end_matches('0');
    let point = if digits.is_empty() { "" } else { "." };
    format!("{sign}0x{lead}{point}{digits}p{exponent:+}")
}

/// Reads a number, hexadecimal or decimal; None for anything else, and for a hexadecimal one that is not an f32 to the
/// bit.
pub fn from_text(text: &str) -> Option<f32> {
    let text = text.trim();
    let (negative, size) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let Some(hex) = size.strip_prefix("0x").or_else(|| size.strip_prefix("0X")) else {
        return text.parse().ok();
    };
    let (digits, exponent) = hex.split_once(['p', 'P']).unwrap_or((hex, "0"));
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    if whole.len() + part.len() == 0 || whole.len() + part.len() > 12 {
        return None;
    }
    let mantissa = u64::from_str_radix(&format!("{whole}{part}"), 16).ok()?;
    let exponent = exponent.parse::<i32>().ok()?.clamp(-2000, 2000) - 4 * part.len() as i32;
    // At most 48 bits: exact in f64, and all that an f32 may be scaled to is.
    let value = libm::scalbn(mantissa as f64, exponent);
    let x = value as f32;
    (f64::from(x) == value && x.is_finite()).then_some(if negative { -x } else { x })
}

/// A ray as `--ray` takes it: origin, direction, tmin and tmax; and its time, if that is not 0.
pub fn ray_to_hex(ray: &Ray) -> String {
    let Ray { origin: o, direction: d, tmin, tmax, time } = *ray;
    let numbers = [o.x, o.y, o.z, d.x, d.y, d.z, tmin, tmax, time];
    let told = if time == 0.0 { &numbers[..8] } else { &numbers[..] };
    told.iter().map(|&x| to_hex(x)).collect::<Vec<_>>().join(",")
}

/// Reads six numbers, or seven or eight with a range, or nine with a time, too; otherwise what is wrong with them.
///
/// # Errors
/// A sentence, where there are more or fewer numbers, and where one is none.
pub fn ray_from_text(text: &str) -> Result<Ray, String> {
    let number = |word: &str| from_text(word).ok_or_else(|| format!("{word:?} is not a number"));
    let numbers: Vec<f32> = text.split(',').map(number).collect::<Result<_, _>>()?;
    let [ox, oy, oz, dx, dy, dz, range @ ..] = &numbers[..] else {
        return Err(format!("{} numbers; a ray is ox,oy,oz,dx,dy,dz[,tmin[,tmax[,time]]]", numbers.len()));
    };
    if range.len() > 3 {
        return Err(format!("{} numbers; a ray has nine at most, ox,oy,oz,dx,dy,dz,tmin,tmax,time", numbers.len()));
    }
    let mut ray = Ray::new(Vec3::new(*ox, *oy, *oz), Vec3::new(*dx, *dy, *dz));
    ray.tmin = range.first().copied().unwrap_or(ray.tmin);
    ray.tmax = range.get(1).copied().unwrap_or(ray.tmax);
    ray.time = range.get(2).copied().unwrap_or(ray.time);
    Ok(ray)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    #[test]
    fn known_numbers() {
        for (x, text) in [
            (0.0, "0x0p+0"),
            (-0.0, "-0x0p+0"),
            (1.0, "0x1p+0"),
            (3.0, "0x1.8p+1"),
            (-0.1, "-0x1.99999ap-4"),
            (f32::MAX, "0x1.fffffep+127"),
            (f32::from_bits(1), "0x0.000002p-126"),
            (f32::INFINITY, "inf"),
        ] {
            assert_eq!(to_hex(x), text);
            assert_eq!(from_text(text).map(f32::to_bits), Some(x.to_bits()));
        }
        assert_eq!(from_text("0x10p-2"), Some(4.0));
        assert_eq!(from_text(" 0.25"), Some(0.25));
    }

    #[test]
    fn every_number_comes_back() {
        let mut random = Random::new(1, 0);
        for _ in 0..20_000 {
            let x = f32::from_bits(random.bits() as u32);
            if !x.is_nan() {
                assert_eq!(from_text(&to_hex(x)).map(f32::to_bits), Some(x.to_bits()), "{x:e}");
            }
        }
    }

    #[test]
    fn rays_come_back() {
        let ray = Ray { tmin: 0.1, ..Ray::new(Vec3::new(1.0, -0.0, 1e-40), Vec3::new(0.3, 5e10, -2.0)) };
        assert_eq!(ray_from_text(&ray_to_hex(&ray)), Ok(ray));
        assert_eq!(ray_from_text("0,0,1, 0,0,-1"), Ok(Ray::new(Vec3::Z, Vec3::NEG_Z)));
        assert!(ray_from_text("1,2,3").unwrap_err().contains("3 numbers"));
        assert!(ray_from_text("1,2,3,4,five,6").unwrap_err().contains("five"));
        assert!(ray_from_text("1,2,3,4,5,6,7,8,9,10").unwrap_err().contains("nine at most"));
        let moving = Ray { time: 0.25, ..Ray::new(Vec3::X, Vec3::Y) };
        assert_eq!(ray_from_text(&ray_to_hex(&moving)), Ok(moving));
    }

    #[test]
    fn what_is_no_number() {
        // The last two have too many bits, and too large an exponent.
        for text in ["", "0x", "0xp1", "one", "0x1.8q1", "0x1.8p", "0x1.000001p+0", "0x1p+128"] {
            assert_eq!(from_text(text), None, "{text}");
        }
    }
}
