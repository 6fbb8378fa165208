//! Numbers of the interface. Plain integers: C callers may pass any.

/// No geometry, no instance.
pub const INVALID_ID: u32 = u32::MAX;

/// Steps of motion at most.
pub const MAX_TIME_STEPS: u32 = 129;

/// What a buffer holds an item of.
pub mod format {
    pub const UINT: u32 = 0x5001;
    pub const UINT3: u32 = 0x5003;
    pub const UINT4: u32 = 0x5004;
    pub const UCHAR: u32 = 0x1001;
    pub const FLOAT: u32 = 0x9001;
    pub const FLOAT3: u32 = 0x9003;
    pub const FLOAT4: u32 = 0x9004;
    pub const FLOAT16: u32 = 0x9010;
    pub const FLOAT3X4_ROW_MAJOR: u32 = 0x9134;
    pub const FLOAT3X4_COLUMN_MAJOR: u32 = 0x9234;
    pub const FLOAT4X4_COLUMN_MAJOR: u32 = 0x9244;
    pub const GRID: u32 = 0xA001;
    pub const QUATERNION_DECOMPOSITION: u32 = 0xB001;

    /// Bytes of an item; 0 of formats of which no item is read.
    pub fn bytes(format: u32) -> usize {
        match format {
            UCHAR => 1,
            UINT..=UINT4 | FLOAT..=FLOAT16 => 4 * (format & 0xff) as usize,
            GRID => size_of::<super::super::RTCGrid>(),
            FLOAT3X4_ROW_MAJOR | FLOAT3X4_COLUMN_MAJOR => 48,
            FLOAT4X4_COLUMN_MAJOR | QUATERNION_DECOMPOSITION => 64,
            _ => 0,
        }
    }
}

/// What a buffer is for.
pub mod buffer_type {
    pub const INDEX: u32 = 0;
    pub const VERTEX: u32 = 1;
    pub const VERTEX_ATTRIBUTE: u32 = 2;
    pub const NORMAL: u32 = 3;
    pub const GRID: u32 = 8;
    pub const FLAGS: u32 = 32;
    /// Of instance arrays.
    pub const TRANSFORM: u32 = 23;
}

/// Kinds of geometry.
pub mod geometry_type {
    pub const TRIANGLE: u32 = 0;
    pub const QUAD: u32 = 1;
    pub const GRID: u32 = 2;
    pub const SUBDIVISION: u32 = 8;
    pub const CONE_LINEAR_CURVE: u32 = 15;
    pub const ROUND_LINEAR_CURVE: u32 = 16;
    pub const FLAT_LINEAR_CURVE: u32 = 17;
    pub const SPHERE_POINT: u32 = 50;
    pub const DISC_POINT: u32 = 51;
    pub const ORIENTED_DISC_POINT: u32 = 52;
    pub const USER: u32 = 120;
    pub const INSTANCE: u32 = 121;
    #[cfg(feature = "v4")]
    pub const INSTANCE_ARRAY: u32 = 122;
}

/// How much work goes into a tree.
pub mod quality {
    pub const LOW: u32 = 0;
    pub const MEDIUM: u32 = 1;
    pub const HIGH: u32 = 2;
    pub const REFIT: u32 = 3;
}

/// Flags of a scene.
pub mod scene_flag {
    pub const DYNAMIC: u32 = 1;
    pub const COMPACT: u32 = 1 << 1;
    pub const ROBUST: u32 = 1 << 2;
    /// Of version 3: that of the context; of version 4: that of the arguments.
    pub const FILTER_IN_ARGUMENTS: u32 = 1 << 3;
}

/// Flags of a query; that of coherent rays is not asked, since rays are looked at.
#[cfg(feature = "v4")]
pub mod query_flag {
    pub const INVOKE_ARGUMENT_FILTER: u32 = 1 << 1;
}

/// What a device can be asked about itself.
pub mod property {
    pub const VERSION: u32 = 0;
    pub const VERSION_MAJOR: u32 = 1;
    pub const VERSION_MINOR: u32 = 2;
    pub const VERSION_PATCH: u32 = 3;
    pub const NATIVE_RAY4: u32 = 32;
    pub const NATIVE_RAY8: u32 = 33;
    pub const NATIVE_RAY16: u32 = 34;
    pub const RAY_STREAM: u32 = 35;
    pub const BACKFACE_CULLING_SPHERES: u32 = 62;
    pub const BACKFACE_CULLING_CURVES: u32 = 63;
    pub const RAY_MASK: u32 = 64;
    pub const BACKFACE_CULLING: u32 = 65;
    pub const FILTER_FUNCTION: u32 = 66;
    pub const IGNORE_INVALID_RAYS: u32 = 67;
    pub const COMPACT_POLYS: u32 = 68;
    pub const TRIANGLES: u32 = 96;
    pub const QUADS: u32 = 97;
    pub const SUBDIVISION: u32 = 98;
    pub const CURVES: u32 = 99;
    pub const USER: u32 = 100;
    pub const POINTS: u32 = 101;
    pub const TASKING_SYSTEM: u32 = 128;
    pub const JOIN_COMMIT: u32 = 129;
    pub const PARALLEL_COMMIT: u32 = 130;
    pub const CPU_DEVICE: u32 = 140;
    pub const SYCL_DEVICE: u32 = 141;
}
