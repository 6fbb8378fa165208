//! What is known to fail where: measured, and held in both directions.
//!
//! A method that is mended shows as well as one that is broken. For [`Setup::RAYS`](super::Setup::RAYS) rays and
//! [`Setup::SEED`](super::Setup::SEED); with others nothing but the gates of what is exact is held.

use super::Column;

/// What is on record of the textbooks' methods: side-planes, same-side, areas, moeller-trumbore, woop, then of spheres:
/// algebraic, geometric, accurate. A dot where no accelerator fails with it, a cross where each does, a dash between; a
/// space where nothing in the case is about it.
const RECORD: &[(&str, &str)] = &[];

/// What is on record of Embree: robust, fast, compact. A question mark where its version or the processor decides.
const EMBREE: &[(&str, &str)] = &[];

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
        }
    }
}
