//! Rays and hits.

/// One ray.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
pub struct RTCRay {
    pub org: [f32; 3],
    pub tnear: f32,
    pub dir: [f32; 3],
    pub time: f32,
    /// Where it ends; of a query's answer, the hit's t, or minus infinity for an occluded ray.
    pub tfar: f32,
    pub mask: u32,
    pub id: u32,
    pub flags: u32,
}

/// One hit.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
pub struct RTCHit {
    /// Normal of the geometry, in its own coordinates; not of unit length.
    pub ng: [f32; 3],
    pub u: f32,
    pub v: f32,
    pub primitive: u32,
    pub geometry: u32,
    pub instance: InstanceId,
}

/// An instance, and of an instance array which of its instances; outside of all where nothing is in one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstanceId {
    geometry: u32,
    #[cfg(instance_primitives)]
    primitive: u32,
}

impl InstanceId {
    /// None.
    pub const OUTSIDE: Self = Self::new(super::INVALID_ID, super::INVALID_ID);

    /// Where there are no numbers within arrays, all of one array are alike.
    pub const fn new(geometry: u32, _primitive: u32) -> Self {
        Self {
            geometry,
            #[cfg(instance_primitives)]
            primitive: _primitive,
        }
    }

    /// Whether it is one. What callers leave in the number within arrays is nothing.
    pub const fn is_inside(self) -> bool {
        self.geometry != super::INVALID_ID
    }

    /// As words of a hit.
    pub const fn words(self) -> [u32; INSTANCE_WORDS] {
        [
            self.geometry,
            #[cfg(instance_primitives)]
            self.primitive,
        ]
    }
}

/// Words of an instance's number.
pub const INSTANCE_WORDS: usize = size_of::<InstanceId>() / 4;

/// Words of a hit in structures of arrays.
pub const HIT_WORDS: usize = 7 + INSTANCE_WORDS;

/// Words of a ray in structures of arrays.
pub const RAY_WORDS: usize = 12;

/// One ray and its hit.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCRayHit {
    pub ray: RTCRay,
    pub hit: RTCHit,
}

const _: () = {
    assert!(size_of::<RTCRay>() == 48 && std::mem::offset_of!(RTCRay, tfar) == 32);
    assert!(size_of::<RTCRayHit>() == if cfg!(instance_primitives) { 96 } else { 80 });
    assert!(std::mem::offset_of!(RTCHit, instance) == 28);
};

impl RTCHit {
    /// None.
    pub const NONE: Self = Self {
        ng: [0.0; 3],
        u: 0.0,
        v: 0.0,
        primitive: super::INVALID_ID,
        geometry: super::INVALID_ID,
        instance: InstanceId::OUTSIDE,
    };
}

/// Pointers to arrays of each component.
#[cfg(feature = "v3")]
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCRayHitNp {
    /// Those of [`RTCRay`], then those of [`RTCHit`].
    pub words: [*mut u32; RAY_WORDS + HIT_WORDS],
}
