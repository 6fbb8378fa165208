//! The primitives of one coordinate system as numbered items with boxes, which is all that an index knows of them.

use std::ops::Range;

use crate::math::{Aabb, DVec3, Vec3, is_traceable};
use crate::ray::Ray;
use crate::shape::Shape;
use crate::shape::triangle::Placed;
use crate::trace::leaf::{Id, InstanceTransform, Methods};
use crate::trace::nearest::Nearest;
use crate::trace::{Part, Primitives};

/// Everything in one coordinate system that has bounds and can be hit: triangles first, then shapes.
pub(super) struct Items {
    triangles: Vec<[Vec3; 3]>,
    shapes: Vec<Shape>,
    ids: Vec<Id>,
    methods: Methods,
}

/// What an index is built from.
pub(super) struct Input<'a> {
    /// A box around each item; none is empty.
    pub boxes: &'a [Aabb],
    /// Items that belong together, in order: those of one geometry.
    pub groups: &'a [Range<u32>],
    /// Corners of the items that are triangles, which come first.
    pub triangles: &'a [[Vec3; 3]],
}

/// The boxes that an index is built over, and which of them belong together.
pub(super) struct Boxes {
    boxes: Vec<Aabb>,
    groups: Vec<Range<u32>>,
}

impl Items {
    /// The primitives of `parts`, but for those without bounds and those that nothing can hit.
    pub fn new(parts: &[Part], methods: Methods) -> (Self, Boxes) {
        let mut items = Self { triangles: Vec::new(), shapes: Vec::new(), ids: Vec::new(), methods };
        let mut list = Boxes { boxes: Vec::new(), groups: Vec::new() };
        for part in parts {
            let Primitives::Triangles { positions, triangles } = &part.primitives else { continue };
            for (indices, primitive) in triangles.iter().zip(0..) {
                let corners = indices.map(|i| positions[i as usize]);
                if corners.iter().all(|&p| is_traceable(p)) {
                    items.triangles.push(corners);
                    items.ids.push(part.id(part.instance, primitive));
                    list.boxes.push(Aabb::around(corners));
                }
            }
            list.end_group();
        }
        for part in parts {
            let Primitives::Shapes(shapes) = &part.primitives else { continue };
            for (shape, primitive) in shapes.iter().zip(0..) {
                let bounds = shape.bounds();
                if !bounds.is_empty() {
                    items.shapes.push(shape.clone());
                    items.ids.push(part.id(part.instance, primitive));
                    list.boxes.push(bounds);
                }
            }
            list.end_group();
        }
        (items, list)
    }

    pub fn input<'a>(&'a self, boxes: &'a Boxes) -> Input<'a> {
        Input { boxes: &boxes.boxes, groups: &boxes.groups, triangles: &self.triangles }
    }

    /// Whether some are not triangles.
    pub fn has_shapes(&self) -> bool {
        !self.shapes.is_empty()
    }

    /// Offers what `ray`, in the world, hits of one item; `local` is the same ray in the item's coordinates.
    #[inline]
    pub fn offer(
        &self,
        item: u32,
        ray: &Ray,
        local: &Ray,
        through: Option<InstanceTransform<'_>>,
        nearest: &mut Nearest,
    ) {
        let item = item as usize;
        let mut id = self.ids[item];
        if let Some(through) = through {
            id.instance = through.instance;
        }
        match (self.triangles.get(item), through) {
            (Some(corners), None) => self.methods.offer_triangle(nearest, ray, corners, id),
            (Some(&corners), Some(InstanceTransform { to_world, .. })) => {
                self.methods.offer_triangle(nearest, ray, &Placed { corners, to_world }, id);
            }
            (None, through) => {
                let local = through.map(|_| local);
                self.methods.offer_shape(nearest, ray, local, &self.shapes[item - self.triangles.len()], id);
            }
        }
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        let shapes = self.shapes.iter().map(Shape::bytes).sum::<usize>();
        size_of_val(&self.triangles[..]) + size_of_val(&self.ids[..]) + shapes
    }
}

impl Boxes {
    /// Boxes of which none belongs to another.
    pub fn single(boxes: Vec<Aabb>) -> Self {
        let groups = (0..boxes.len() as u32).map(|i| i..i + 1).collect();
        Self { boxes, groups }
    }

    pub fn bounds(&self) -> Aabb {
        bounds_of(self.boxes.iter().copied())
    }

    /// What an index over boxes alone is built from.
    pub fn input(&self) -> Input<'_> {
        Input { boxes: &self.boxes, groups: &self.groups, triangles: &[] }
    }

    fn end_group(&mut self) {
        let start = self.groups.last().map_or(0, |group| group.end);
        let end = self.boxes.len() as u32;
        if end > start {
            self.groups.push(start..end);
        }
    }
}

impl Input<'_> {
    /// All items.
    pub fn all(&self) -> Vec<u32> {
        (0..self.boxes.len() as u32).collect()
    }

    pub fn bounds(&self) -> Aabb {
        bounds_of(self.boxes.iter().copied())
    }
}

/// The box around all of them.
pub(super) fn bounds_of(boxes: impl IntoIterator<Item = Aabb>) -> Aabb {
    boxes.into_iter().fold(Aabb::EMPTY, Aabb::union)
}

/// The largest coordinate of a box on each axis; 0 where it is empty.
pub(super) fn reach(bounds: &Aabb) -> DVec3 {
    if bounds.is_empty() { DVec3::ZERO } else { bounds.min.abs().max(bounds.max.abs()).as_dvec3() }
}
