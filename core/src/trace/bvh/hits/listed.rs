//! What a single ray hits among triangles, for whoever decides it by the corners that are meant
//! ([`crate::trace::bvh::certain`]).

use super::found::NONE;

/// What a ray hits for sure, all of it or what may be the nearest; what it may hit; and whether nothing can be said.
#[derive(Clone, Copy)]
pub(in crate::trace::bvh) struct Listed {
    /// Block and lane of each: from the front of those that are sure, from the back of those that are not.
    ids: [u32; Self::MAX],
    /// Bounds on t of those that are sure.
    t: [[f32; 2]; Self::MAX],
    sures: usize,
    opens: usize,
    is_in_doubt: bool,
}

impl Listed {
    /// As many as are kept; a ray with more is in doubt.
    const MAX: usize = 24;
    pub const NONE: Self =
        Self { ids: [NONE; Self::MAX], t: [[0.0; 2]; Self::MAX], sures: 0, opens: 0, is_in_doubt: false };

    /// Nothing again.
    #[inline(always)]
    pub fn start(&mut self) {
        (self.sures, self.opens, self.is_in_doubt) = (0, 0, false);
    }

    #[inline(always)]
    fn has_room(&mut self) -> bool {
        self.is_in_doubt |= self.sures + self.opens >= Self::MAX;
        !self.is_in_doubt
    }

    /// Nothing that is hit for sure.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.sures = 0;
    }

    /// One that is hit for sure.
    #[inline(always)]
    pub fn push(&mut self, id: u32, t: [f32; 2]) {
        if self.has_room() {
            (self.ids[self.sures], self.t[self.sures]) = (id, t);
            self.sures += 1;
        }
    }

    /// One that may be hit.
    #[inline(always)]
    pub fn push_open(&mut self, id: u32) {
        if self.has_room() {
            self.opens += 1;
            self.ids[Self::MAX - self.opens] = id;
        }
    }

    /// Those that are hit for sure.
    #[inline(always)]
    pub fn sure(&self) -> &[u32] {
        &self.ids[..self.sures.min(Self::MAX)]
    }

    /// Bounds on their t.
    #[inline(always)]
    pub fn t(&self) -> &[[f32; 2]] {
        &self.t[..self.sures.min(Self::MAX)]
    }

    /// Those that may be hit.
    #[inline(always)]
    pub fn open(&self) -> &[u32] {
        &self.ids[Self::MAX - self.opens.min(Self::MAX)..]
    }

    /// Leaves the ray to the caller.
    #[inline(always)]
    pub fn doubt(&mut self) {
        self.is_in_doubt = true;
    }

    /// Whether it is.
    #[inline(always)]
    pub fn is_in_doubt(&self) -> bool {
        self.is_in_doubt
    }
}
