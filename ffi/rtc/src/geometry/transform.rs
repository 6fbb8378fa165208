//! Transforms of instances: how they are written down, and how they move.

use twincast_core::math::{Affine3, DMat3, DQuat, Mat3, Vec3};

use super::{Kind, State, TimeSteps};
use crate::abi::{RTCQuaternionDecomposition, format};
use crate::buffer::View;
use crate::failure::{Failure, Result};

/// Where an instance is at a time step.
#[derive(Clone, Copy, Debug)]
pub enum Transform {
    Matrix(Affine3),
    /// Interpolated part by part.
    Quaternion(RTCQuaternionDecomposition),
}

impl Transform {
    pub const IDENTITY: Self = Self::Matrix(Affine3::IDENTITY);

    fn matrix(&self) -> Affine3 {
        match self {
            Self::Matrix(matrix) => *matrix,
            Self::Quaternion(parts) => compose(parts),
        }
    }
}

/// Floats of a matrix in a format.
pub fn words(given: u32) -> Option<usize> {
    match given {
        format::FLOAT3X4_ROW_MAJOR | format::FLOAT3X4_COLUMN_MAJOR => Some(12),
        format::FLOAT4X4_COLUMN_MAJOR => Some(16),
        format::QUATERNION_DECOMPOSITION => Some(16),
        _ => None,
    }
}

/// A matrix from its floats, of which there are as many as [`words`] says.
pub fn read(given: u32, m: &[f32]) -> Result<Affine3> {
    let column = |x: usize, y: usize, z: usize| Vec3::new(m[x], m[y], m[z]);
    let [x, y, z, t] = match given {
        format::FLOAT3X4_COLUMN_MAJOR => [column(0, 1, 2), column(3, 4, 5), column(6, 7, 8), column(9, 10, 11)],
        format::FLOAT4X4_COLUMN_MAJOR => [column(0, 1, 2), column(4, 5, 6), column(8, 9, 10), column(12, 13, 14)],
        format::FLOAT3X4_ROW_MAJOR => [column(0, 4, 8), column(1, 5, 9), column(2, 6, 10), column(3, 7, 11)],
        _ => return Err(Failure::operation("invalid matrix format")),
    };
    Ok(Affine3 { matrix3: Mat3::from_cols(x, y, z), translation: t })
}

/// The floats of a matrix.
pub fn write(given: u32, matrix: &Affine3) -> Result<Vec<f32>> {
    let columns = [matrix.matrix3.x_axis, matrix.matrix3.y_axis, matrix.matrix3.z_axis, matrix.translation];
    let row = |axis: usize| columns.map(|column| column[axis]);
    let last = [0.0, 0.0, 0.0, 1.0];
    Ok(match given {
        format::FLOAT3X4_COLUMN_MAJOR => columns.iter().flat_map(Vec3::to_array).collect(),
        format::FLOAT4X4_COLUMN_MAJOR => {
            columns.iter().zip(last).flat_map(|(column, w)| [column.x, column.y, column.z, w]).collect()
        }
        format::FLOAT3X4_ROW_MAJOR => [row(0), row(1), row(2)].concat(),
        _ => return Err(Failure::operation("invalid matrix format")),
    })
}

/// A translation, a rotation, a shear and a scale about a shifted origin, applied from the right.
fn compose(parts: &RTCQuaternionDecomposition) -> Affine3 {
    let rotation = DMat3::from_quat(quaternion(parts)).as_mat3();
    let ([sx, sy, sz], [xy, xz, yz]) = (parts.scale, parts.skew);
    let scale = Mat3::from_cols(Vec3::new(sx, 0.0, 0.0), Vec3::new(xy, sy, 0.0), Vec3::new(xz, yz, sz));
    let matrix3 = rotation * scale;
    Affine3 { matrix3, translation: Vec3::from(parts.translation) + rotation * Vec3::from(parts.shift) }
}

fn quaternion(parts: &RTCQuaternionDecomposition) -> DQuat {
    let [r, i, j, k] = parts.quaternion.map(f64::from);
    DQuat::from_xyzw(i, j, k, r).normalize()
}

/// Between two of them: rotations along the great circle (Shoemake 1985, *Animating rotation with quaternion curves*),
/// all else linearly.
fn between(a: &RTCQuaternionDecomposition, b: &RTCQuaternionDecomposition, at: f32) -> Affine3 {
    let mix = |a: [f32; 3], b: [f32; 3]| Vec3::from(a).lerp(Vec3::from(b), at).to_array();
    let turned = quaternion(a).slerp(quaternion(b), f64::from(at)).as_quat();
    compose(&RTCQuaternionDecomposition {
        scale: mix(a.scale, b.scale),
        skew: mix(a.skew, b.skew),
        shift: mix(a.shift, b.shift),
        quaternion: [turned.w, turned.x, turned.y, turned.z],
        translation: mix(a.translation, b.translation),
    })
}

/// Where an instance is at each time.
pub type Motion = TimeSteps<Transform>;

/// How many places between two steps are looked at, where a path is not straight.
const PLACES: usize = 32;

impl Motion {
    /// Of one instance of a geometry; `transforms` are those of a geometry that is one instance.
    pub fn of(kind: Kind, state: &State, transforms: &[Transform], primitive: usize) -> Result<Self> {
        let range = state.time_range;
        if kind == Kind::Instance {
            return Ok(Self::new(transforms.into(), range));
        }
        let steps = state.transform_buffers.iter().map(|view| transform_of(view.as_ref(), primitive));
        Ok(Self::new(steps.collect::<Result<_>>()?, range))
    }

    /// Where it is.
    pub fn at(&self, time: f32) -> Affine3 {
        let (before, after) = self.around(time);
        after.map_or_else(|| before.matrix(), |(after, fraction)| mix(before, after, fraction))
    }

    /// Times from 0 to 1 and where it is then, between which everything moves in straight lines, or nearly: by how much
    /// points within `reach` of the origin may stray from these lines. None where it is not there in that time. Of what
    /// moves.
    pub fn places(&self, reach: f32) -> (Vec<(f32, Affine3)>, f32) {
        let (begin, end) = self.range();
        let (first, last) = (begin.max(0.0), end.min(1.0));
        if first > last {
            return (Vec::new(), 0.0);
        }
        let mut places = vec![(first, self.at(first))];
        let mut stray: f32 = 0.0;
        let segments = (self.len() - 1) as f32;
        for (step, pair) in self.windows(2).enumerate() {
            let mut count = 1;
            if let [Transform::Quaternion(a), Transform::Quaternion(b)] = pair {
                count = PLACES;
                stray = stray.max(sagitta(a, b, reach));
            }
            for i in 0..=count {
                let fraction = i as f32 / count as f32;
                let time = begin + (end - begin) * ((step as f32 + fraction) / segments);
                if first < time && time < last {
                    places.push((time, mix(&pair[0], &pair[1], fraction)));
                }
            }
        }
        places.push((last, self.at(last)));
        (places, stray)
    }
}

/// The place between two steps.
fn mix(a: &Transform, b: &Transform, fraction: f32) -> Affine3 {
    if let (Transform::Quaternion(a), Transform::Quaternion(b)) = (a, b) {
        return between(a, b, fraction);
    }
    let (a, b) = (a.matrix(), b.matrix());
    let mix = |a: Vec3, b: Vec3| a * (1.0 - fraction) + b * fraction;
    let columns = |k: usize| mix(a.matrix3.col(k), b.matrix3.col(k));
    let matrix3 = Mat3::from_cols(columns(0), columns(1), columns(2));
    Affine3 { matrix3, translation: mix(a.translation, b.translation) }
}

/// By how much a point within `reach` may stray from the line between two neighbouring places of a turn.
///
/// An eighth of the square of the step times the most that its acceleration may be: it turns by half a turn at most,
/// while the arm that is turned changes evenly.
fn sagitta(a: &RTCQuaternionDecomposition, b: &RTCQuaternionDecomposition, reach: f32) -> f32 {
    const TURN: f32 = std::f32::consts::PI;
    let length = |parts: &RTCQuaternionDecomposition, from: &RTCQuaternionDecomposition| {
        let square = |a: &[f32; 3], b: &[f32; 3]| Vec3::from(*a).distance_squared(Vec3::from(*b));
        (square(&parts.scale, &from.scale) + square(&parts.skew, &from.skew)).sqrt() * reach
            + square(&parts.shift, &from.shift).sqrt()
    };
    let none = RTCQuaternionDecomposition { scale: [0.0; 3], skew: [0.0; 3], shift: [0.0; 3], ..*a };
    let arm = length(a, &none).max(length(b, &none));
    (TURN * TURN * arm + 2.0 * TURN * length(a, b)) / (8 * PLACES * PLACES) as f32
}

fn transform_of(view: Option<&View>, primitive: usize) -> Result<Transform> {
    let missing = || Failure::operation("an instance array without transforms");
    let view = view.ok_or_else(missing)?;
    match view.format() {
        format::QUATERNION_DECOMPOSITION => {
            let [sx, sy, sz, xy, xz, yz, ax, ay, az, r, i, j, k, tx, ty, tz] =
                view.floats::<16>(primitive).ok_or_else(missing)?;
            Ok(Transform::Quaternion(RTCQuaternionDecomposition {
                scale: [sx, sy, sz],
                skew: [xy, xz, yz],
                shift: [ax, ay, az],
                quaternion: [r, i, j, k],
                translation: [tx, ty, tz],
            }))
        }
        format::FLOAT3X4_ROW_MAJOR | format::FLOAT3X4_COLUMN_MAJOR => {
            read(view.format(), &view.floats::<12>(primitive).ok_or_else(missing)?).map(Transform::Matrix)
        }
        _ => read(view.format(), &view.floats::<16>(primitive).ok_or_else(missing)?).map(Transform::Matrix),
    }
}
