//! Letters as strokes, for pictures that have no fonts: lines between the crossings of a grid.
//!
//! The grid has columns 0 to 4 and rows 0 to 8; capitals reach from row 0 to row 6, the line they stand on, small
//! letters begin at row 2, and what hangs below ends at row 8. A stroke is written as its points, column and row;
//! strokes are parted by blanks.

/// Columns from one letter to the next.
pub(super) const ADVANCE: f64 = 6.0;
/// The row that letters stand on.
pub(super) const BASELINE: f64 = 6.0;

/// The strokes of a letter; a question mark stands for what there is none for.
pub(super) fn strokes(letter: char) -> impl Iterator<Item = Vec<(f64, f64)>> {
    drawn(letter).split(' ').filter(|stroke| !stroke.is_empty()).map(|stroke| {
        let digits: Vec<f64> = stroke.bytes().map(|digit| f64::from(digit - b'0')).collect();
        digits.chunks_exact(2).map(|point| (point[0], point[1])).collect()
    })
}

const fn drawn(letter: char) -> &'static str {
    match letter {
        ' ' => "",
        '!' => "2024 2626",
        '"' => "1012 3032",
        '#' => "1016 3036 0242 0444",
        '$' => "413010010213334445361605 2026",
        '%' => "0640 0101 4545",
        '&' => "46021120310405162644",
        '\'' => "2022",
        '(' => "302112142536",
        ')' => "102132342516",
        '*' => "2226 0345 4305",
        '+' => "2226 0444",
        ',' => "2617",
        '-' | '\u{2013}' | '\u{2014}' => "1434",
        '.' => "2626",
        '/' => "0640",
        '0' => "103041453616050110",
        '1' => "112026 1636",
        '2' => "01103041420646",
        '3' => "004022324345361605",
        '4' => "36300444",
        '5' => "4000023243453606",
        '6' => "301001051636454433 3303",
        '7' => "004016",
        '8' => "13020110304142331304051636454433",
        '9' => "163645413010010213 1343",
        ':' => "2323 2626",
        ';' => "2323 2617",
        '<' => "420446",
        '=' => "0343 0545",
        '>' => "024406",
        '?' => "01103041422324 2626",
        '@' => "34141232354541301001051646",
        'A' => "062046 1434",
        'B' => "000636454433 3303 33424130 3000",
        'C' => "4130100105163645",
        'D' => "00062644422000",
        'E' => "40000646 0333",
        'F' => "400006 0333",
        'G' => "41301001051636454323",
        'H' => "0006 4046 0343",
        'I' => "1030 2026 1636",
        'J' => "4045361605",
        'K' => "0006 4003 0346",
        'L' => "000646",
        'M' => "0600234046",
        'N' => "06004640",
        'O' => "103041453616050110",
        'P' => "06003041423303",
        'Q' => "103041453616050110 2446",
        'R' => "06003041423303 2346",
        'S' => "413010010213334445361605",
        'T' => "0040 2026",
        'U' => "000516364540",
        'V' => "002640",
        'W' => "0016223640",
        'X' => "0046 4006",
        'Y' => "002340 2326",
        'Z' => "00400646",
        '[' => "30101636",
        '\\' => "0046",
        ']' => "10303616",
        '^' => "022042",
        '_' => "0747",
        '`' => "1021",
        'a' => "12324346 441405163645",
        'b' => "00063645433202",
        'c' => "4332120305163645",
        'd' => "40461605031242",
        'e' => "044443321203051636",
        'f' => "41302126 1232",
        'g' => "42473818 421203051646",
        'h' => "0006 0312324346",
        'i' => "2226 2020",
        'j' => "32372818 3030",
        'k' => "0006 4204 2346",
        'l' => "202536",
        'm' => "0206 03122326 23324346",
        'n' => "0206 0312324346",
        'o' => "123243453616050312",
        'p' => "0208 023243453606",
        'q' => "4248 421203051646",
        'r' => "0206 042242",
        's' => "4212031434453606",
        't' => "10152636 0232",
        'u' => "020516364542 4246",
        'v' => "022642",
        'w' => "0216233642",
        'x' | '\u{d7}' => "0246 4206",
        'y' => "0226 4218",
        'z' => "02420646",
        '{' => "30212213242536",
        '|' => "2027",
        '}' => "10212233242516",
        '~' => "04133544",
        '\u{2026}' => "0606 2626 4646",
        _ => drawn('?'),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_is_drawn_on_the_grid_and_unlike_the_others() {
        let mut seen = std::collections::BTreeSet::new();
        for letter in ' '..='~' {
            let strokes: Vec<_> = strokes(letter).collect();
            let points = strokes.iter().flatten();
            assert!(points.clone().all(|&(x, y)| (0.0..=4.0).contains(&x) && (0.0..=8.0).contains(&y)), "{letter:?}");
            assert!(strokes.iter().all(|stroke| stroke.len() >= 2) && strokes.is_empty() == (letter == ' '));
            let digits = drawn(letter).split(' ').all(|stroke| stroke.len() % 2 == 0);
            assert!(digits, "{letter:?}");
            // The zero and the letter look alike in most typefaces.
            assert!(seen.insert(drawn(letter)) || letter == 'O', "{letter:?}");
        }
        assert_eq!(strokes('\u{4e00}').count(), strokes('?').count());
    }
}
