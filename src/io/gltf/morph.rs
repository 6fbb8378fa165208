//! Morph targets: displacements of attributes, each times its weight.

use super::accessor::View;
use super::attributes::Attributes;
use super::schema::Primitive;
use crate::error::Result;

/// The displacements of one attribute.
pub(super) struct Displacements<'v>(Vec<(f64, View<'v>)>);

impl<'v> Displacements<'v> {
    /// Those of an attribute; none where no target with a weight displaces it.
    pub(super) fn of(
        attributes: &Attributes<'v>,
        primitive: &Primitive,
        weights: &[f32],
        name: &str,
        kinds: &[&str],
    ) -> Result<Option<Self>> {
        let mut targets = Vec::new();
        for (target, &weight) in primitive.targets.iter().zip(weights) {
            if let (Some(&index), true) = (target.get(name), weight != 0.0) {
                targets.push((f64::from(weight), attributes.accessor(index, name, kinds)?));
            }
        }
        Ok(if targets.is_empty() { None } else { Some(Self(targets)) })
    }

    /// What becomes of an attribute at each vertex that is used, displaced where a target does so.
    pub(super) fn read<const N: usize, T: Send>(
        attributes: &Attributes<'v>,
        targets: (&Primitive, &[f32]),
        (name, kinds): (&str, &[&str]),
        view: &View<'_>,
        make: impl Fn([f32; N]) -> T + Sync,
    ) -> Result<Vec<T>> {
        let (primitive, weights) = targets;
        let Some(displacements) = Self::of(attributes, primitive, weights, name, kinds)? else {
            return Ok(attributes.read(view, make));
        };
        let displaced = |vertex| displacements.apply(vertex, view.floats::<N>(vertex).map(f64::from));
        Ok(attributes.each(|vertex| make(displaced(vertex).map(|x| x as f32))))
    }

    /// A vertex's value, displaced.
    pub(super) fn apply<const N: usize>(&self, vertex: usize, value: [f64; N]) -> [f64; N] {
        self.0.iter().fold(value, |value, (weight, target)| {
            let by: [f32; N] = target.floats(vertex);
            std::array::from_fn(|k| value[k] + weight * f64::from(by[k]))
        })
    }
}
