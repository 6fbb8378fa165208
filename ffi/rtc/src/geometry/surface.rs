//! Triangles, quads and grids, all as triangles; and what a hit with one of these is in terms of the geometry.
//!
//! A quad v0 v1 v2 v3 is the triangles (v0, v1, v3) and (v2, v3, v1), of which the second counts u and v from the other
//! end; a grid is a quad a cell. So watertightness and exactness are those of triangles.

use std::sync::Arc;

use twincast_core::math::{Aabb, Vec3, is_traceable};

use super::{Kind, State, TimeSteps};
use crate::abi::RTCGrid;
use crate::buffer::View;
use crate::failure::{Failure, Result};

/// A cell of a grid.
#[derive(Clone, Copy, Debug)]
struct Cell {
    grid: u32,
    x: u16,
    y: u16,
    /// Cells in a row and in a column of its grid.
    size: [u16; 2],
}

/// What every two triangles are.
#[derive(Clone, Debug)]
enum Pairs {
    /// Nothing: each triangle is a primitive.
    None,
    Quads,
    Cells(Vec<Cell>),
}

/// A mesh as it was when its scene was committed.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Vertices, of which the last one is not a number.
    pub steps: TimeSteps<Arc<Vec<Vec3>>>,
    pub triangles: Arc<Vec<[u32; 3]>>,
    pairs: Pairs,
}

/// A hit in terms of the geometry.
#[derive(Clone, Copy, Debug)]
pub struct Named {
    pub primitive: u32,
    pub u: f32,
    pub v: f32,
    pub ng: Vec3,
}

impl Surface {
    /// Reads the buffers.
    pub fn new(kind: Kind, state: &State) -> Result<Self> {
        let steps: Vec<_> = state.vertices.iter().map(|view| read_vertices(view.as_ref())).collect();
        let most = steps.iter().map(Vec::len).min().unwrap_or(0) - 1;
        let reader = Reader { steps: &steps, most: most as u32 };
        let mut triangles = Vec::new();
        let pairs = match kind {
            Kind::Triangles => {
                let index = state.index.as_ref();
                let count = index.map_or(0, |index| index.count());
                triangles.reserve_exact(count);
                let corners = |i| index.and_then(|index| index.words::<3>(i));
                triangles.extend((0..count).filter_map(corners).map(|corners| reader.triangle(corners)));
                Pairs::None
            }
            Kind::Quads => {
                let index = state.index.as_ref();
                let count = index.map_or(0, |index| index.count());
                triangles.reserve_exact(2 * count);
                let corners = |i| index.and_then(|index| index.words::<4>(i));
                triangles.extend((0..count).filter_map(corners).flat_map(|corners| reader.quad(corners)));
                Pairs::Quads
            }
            Kind::Grids => Pairs::Cells(read_grids(state.grids.as_ref(), &reader, &mut triangles)?),
            _ => return Err(Failure::operation("not a mesh")),
        };
        // All of the same length, so that the missing vertex is the same in each.
        let steps = steps.into_iter().map(|mut step| {
            step.truncate(most);
            step.push(Vec3::NAN);
            Arc::new(step)
        });
        let steps = TimeSteps::new(steps.collect(), state.time_range);
        Ok(Self { steps, triangles: Arc::new(triangles), pairs })
    }

    /// Whether each triangle is a primitive.
    pub fn is_plain(&self) -> bool {
        matches!(self.pairs, Pairs::None)
    }

    /// The corners of a triangle among the vertices of a step.
    fn corners(&self, triangle: usize, vertices: &[Vec3]) -> [Vec3; 3] {
        self.triangles[triangle].map(|i| vertices[i as usize])
    }

    /// The same at a time.
    pub fn corners_at(&self, triangle: usize, time: f32) -> [Vec3; 3] {
        let (before, after) = self.steps.around(time);
        let a = self.corners(triangle, before);
        let Some((after, fraction)) = after else { return a };
        let b = self.corners(triangle, after);
        let mix = |k: usize| a[k] * (1.0 - fraction) + b[k] * fraction;
        [mix(0), mix(1), mix(2)]
    }

    /// The box of a triangle at a step; empty for one that cannot be hit.
    pub fn bounds_at(&self, triangle: usize, step: usize) -> Aabb {
        let is_good = |corners: [Vec3; 3]| corners.iter().all(|&corner| is_traceable(corner));
        if self.steps.iter().all(|vertices| is_good(self.corners(triangle, vertices))) {
            Aabb::around(self.corners(triangle, &self.steps[step]))
        } else {
            Aabb::EMPTY
        }
    }

    /// Which primitive a triangle is (a part of).
    pub fn primitive(&self, triangle: u32) -> u32 {
        match &self.pairs {
            Pairs::None => triangle,
            Pairs::Quads => triangle / 2,
            Pairs::Cells(cells) => cells[triangle as usize / 2].grid,
        }
    }

    /// A hit with a triangle at `u`, `v`, whose normal is `ng`, in terms of the geometry.
    #[inline]
    pub fn name(&self, triangle: u32, u: f32, v: f32, ng: Vec3) -> Named {
        if self.is_plain() {
            return Named { primitive: triangle, u, v, ng };
        }
        let (u, v) = if triangle.is_multiple_of(2) { (u, v) } else { (1.0 - u, 1.0 - v) };
        match &self.pairs {
            Pairs::None => Named { primitive: triangle, u, v, ng },
            Pairs::Quads => Named { primitive: triangle / 2, u, v, ng },
            Pairs::Cells(cells) => {
                let Cell { grid, x, y, size } = cells[triangle as usize / 2];
                let (u, v) = ((f32::from(x) + u) / f32::from(size[0]), (f32::from(y) + v) / f32::from(size[1]));
                Named { primitive: grid, u, v, ng }
            }
        }
    }
}

/// Vertices, and one that is not a number.
fn read_vertices(view: Option<&View>) -> Vec<Vec3> {
    let count = view.map_or(0, |view| view.count());
    let mut vertices = Vec::with_capacity(count + 1);
    vertices.extend((0..count).filter_map(|i| view.and_then(|view| view.floats::<3>(i))).map(Vec3::from));
    vertices.resize(count + 1, Vec3::NAN);
    vertices
}

/// From indices to triangles; those that cannot be hit are given the vertex that is not a number.
struct Reader<'a> {
    steps: &'a [Vec<Vec3>],
    most: u32,
}

impl Reader<'_> {
    fn triangle(&self, corners: [u32; 3]) -> [u32; 3] {
        if corners.iter().all(|&i| i < self.most) { corners } else { [self.most; 3] }
    }

    /// None of it counts where one of its vertices does not.
    fn quad(&self, [a, b, c, d]: [u32; 4]) -> [[u32; 3]; 2] {
        let is_good = |&i: &u32| i < self.most && self.steps.iter().all(|step| is_traceable(step[i as usize]));
        if [a, b, c, d].iter().all(is_good) { [[a, b, d], [c, d, b]] } else { [[self.most; 3]; 2] }
    }
}

fn read_grids(view: Option<&View>, reader: &Reader<'_>, triangles: &mut Vec<[u32; 3]>) -> Result<Vec<Cell>> {
    let mut cells = Vec::new();
    let count = view.map_or(0, |view| view.count());
    for (i, [start_vertex, stride, size]) in (0..count).filter_map(|i| Some((i, view?.words::<3>(i)?))) {
        let grid = RTCGrid { start_vertex, stride, width: size as u16, height: (size >> 16) as u16 };
        if grid.width > 32768 || grid.height > 32768 {
            return Err(Failure::argument("grid size out of range"));
        }
        // One without a cell has nothing to hit.
        if grid.width < 2 || grid.height < 2 {
            continue;
        }
        let size = [grid.width - 1, grid.height - 1];
        for y in 0..size[1] {
            for x in 0..size[0] {
                let at = |x: u16, y: u16| {
                    let row = u64::from(y) * u64::from(grid.stride);
                    let vertex = u64::from(grid.start_vertex) + row + u64::from(x);
                    u32::try_from(vertex).unwrap_or(u32::MAX)
                };
                triangles.extend(reader.quad([at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]));
                cells.push(Cell { grid: i as u32, x, y, size });
            }
        }
    }
    Ok(cells)
}
