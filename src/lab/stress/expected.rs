//! What is known to fail where: measured, and held in both directions.
//!
//! A method that is mended shows as well as one that is broken. For [`Setup::RAYS`](super::Setup::RAYS) rays and
//! [`Setup::SEED`](super::Setup::SEED); with others nothing but the gates of what is exact is held.

use super::Column;

/// What is on record of the textbooks' methods: side-planes, same-side, areas, moeller-trumbore, woop, then of spheres:
/// algebraic, geometric, accurate. A dot where no accelerator fails with it, a cross where each does, a dash between; a
/// space where nothing in the case is about it.
const RECORD: &[(&str, &str)] = &[
    ("edge-leak", "xxxxx   "),
    ("vertex-leak", "xxxx-   "),
    ("far-from-origin", "xxxx.   "),
    ("grazing", ".....   "),
    ("in-plane", ".....   "),
    ("tiny", "xxxx.   "),
    ("sliver", "xxxx-   "),
    ("degenerate", "...xx   "),
    ("denormal", "xxxxx   "),
    ("mixed-scale", ".xx..   "),
    ("near-coplanar", "xxxxx   "),
    ("coincident", "xxxxx   "),
    ("far-sphere", ".....xx."),
    ("huge-sphere", "     xxx"),
    ("tangency", "     xx."),
    ("cone-cylinder", "        "),
    ("polygon", "        "),
    ("flush", "xxxxx   "),
    ("box-rims", "        "),
    ("flat-boxes", "xxxxx   "),
    ("soups", "xxxxx   "),
    ("depth", "xxxxx   "),
    ("grid-corners", ".....   "),
    ("split-planes", "x-xxx   "),
    ("not-finite", ".....   "),
    ("instances", "xxxxx   "),
    ("t-range", "....x   "),
    ("lengths", ".....   "),
    ("starts", "....x   "),
];

/// What is on record of Embree: robust, fast, compact. A question mark where its version or the processor decides.
const EMBREE: &[(&str, &str)] = &[
    ("edge-leak", "?xx"),
    ("vertex-leak", ".xx"),
    ("far-from-origin", ".??"),
    ("grazing", "..."),
    ("in-plane", "..."),
    ("tiny", "xxx"),
    ("sliver", "???"),
    ("degenerate", "?.."),
    ("denormal", "xxx"),
    ("mixed-scale", "x.."),
    ("near-coplanar", "xxx"),
    ("coincident", "xxx"),
    ("far-sphere", "..."),
    ("huge-sphere", "..."),
    ("tangency", "..."),
    ("cone-cylinder", "..."),
    ("polygon", "..."),
    ("flush", "xxx"),
    ("box-rims", "..."),
    ("flat-boxes", "xxx"),
    ("soups", "xxx"),
    ("depth", "xxx"),
    ("grid-corners", "..."),
    ("split-planes", "???"),
    ("not-finite", "..."),
    ("instances", "???"),
    ("t-range", "?xx"),
    ("lengths", "xxx"),
    ("starts", ".xx"),
];

/// The mark on record; None where there is none.
pub(super) fn expected(case: &str, column: Column) -> Option<char> {
    if column.is_exact() {
        return Some('.');
    }
    let (record, first) =
        if column.is_native() { (RECORD, Column::is_native as fn(Column) -> bool) } else { (EMBREE, is_foreign as _) };
    let place = super::columns().into_iter().filter(|c| !c.is_exact() && first(*c)).position(|c| c == column)?;
    let marks = record.iter().find(|(name, _)| *name == case)?.1;
    marks.chars().nth(place).filter(|mark| matches!(mark, '.' | '-' | 'x'))
}

fn is_foreign(column: Column) -> bool {
    !column.is_native()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_on_record_exists() {
        let names: Vec<&str> = super::super::catalogue().map(|case| case.name).collect();
        for (record, width) in [(RECORD, 8), (EMBREE, 3)] {
            for (name, marks) in record {
                assert!(names.contains(name), "{name}");
                assert!(marks.len() == width && marks.chars().all(|c| ".-x? ".contains(c)), "{name}: {marks:?}");
            }
            let recorded: Vec<&str> = record.iter().map(|(name, _)| *name).collect();
            assert_eq!(recorded, names, "every case is on record, in the catalogue's order");
        }
    }
}
