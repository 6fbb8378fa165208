//! Accessors: typed views of buffers, checked once, then read by index.

use bytemuck::Zeroable;
use rayon::prelude::*;

use super::component::Component;
use super::document::Document;
use super::schema::Accessor;
use crate::error::Result;
use crate::io::records::Records;
use crate::memory::Mapped;

/// Most bytes that accessors without a buffer view, which are all zero, may stand for.
const MAX_ZEROS: u64 = 1 << 28;

/// Elements that are worth a task of their own.
const MIN_TASK: usize = 1 << 12;

/// A checked accessor: every index below `count` can be read.
pub(super) struct View<'a> {
    pub(super) count: usize,
    component: Component,
    components: usize,
    normalized: bool,
    /// Elements `stride` apart, from the first byte; None for zeros.
    base: Option<(&'a [u8], usize)>,
    /// What the elements are mapped from.
    file: Option<&'a Mapped<'a>>,
    /// Replaced elements: their rising indices, and their values.
    sparse: Option<(Vec<u32>, &'a [u8])>,
}

/// A failure and the JSON pointer below the accessor that it is about.
type Fault = (&'static str, String);

impl<'a> View<'a> {
    /// Checks an accessor whose `type` has to be one of `kinds`.
    pub(super) fn new(document: &'a Document<'_>, index: usize, kinds: &[&str]) -> Result<Self> {
        Self::told(document, index, |accessor| Self::check(document, index, accessor, kinds))
    }

    /// The same where the elements were decoded from elsewhere: as 32-bit floats, one after the other.
    pub(super) fn over(document: &'a Document<'_>, index: usize, kinds: &[&str], bytes: &'a [u8]) -> Result<Self> {
        Self::told(document, index, |accessor| {
            let mut view = Self { component: Component::F32, normalized: false, ..Self::typed(accessor, kinds)? };
            let size = view.components * view.component.size();
            range(bytes, 0, view.count, size, size, view.component)?;
            view.base = Some((bytes, size));
            Ok(view)
        })
    }

    /// Has `check` look at an accessor, and says where its faults are.
    fn told<T>(
        document: &Document<'_>,
        index: usize,
        check: impl FnOnce(&Accessor) -> std::result::Result<T, Fault>,
    ) -> Result<T> {
        let accessors = &document.root.accessors;
        let accessor = accessors.get(index).ok_or_else(|| {
            document.error("/accessors", format!("there is no accessor {index}; there are {}", accessors.len()))
        })?;
        check(accessor).map_err(|(field, message)| document.error(format!("/accessors/{index}{field}"), message))
    }

    /// What an accessor says of its elements, which are zero so far.
    fn typed(accessor: &Accessor, kinds: &[&str]) -> std::result::Result<Self, Fault> {
        let component = Component::from_code(accessor.component_type).map_err(|m| ("/componentType", m))?;
        if !kinds.contains(&accessor.kind.as_str()) {
            return Err(("/type", format!("{:?} where {} belongs", accessor.kind, kinds.join(" or "))));
        }
        let components = match accessor.kind.as_str() {
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            _ => 1,
        };
        let count = u32::try_from(accessor.count)
            .map_err(|_| ("/count", format!("{} elements; at most 2^32 - 1", accessor.count)))?
            as usize;
        let normalized = accessor.normalized;
        Ok(Self { count, component, components, normalized, base: None, file: None, sparse: None })
    }

    fn check(
        document: &'a Document<'_>,
        index: usize,
        accessor: &Accessor,
        kinds: &[&str],
    ) -> std::result::Result<Self, Fault> {
        let mut view = Self::typed(accessor, kinds)?;
        let Self { count, component, components, .. } = view;
        let size = components * component.size();
        view.base = match accessor.buffer_view {
            Some(view) => {
                let (bytes, stride) = document.view(view).map_err(|m| ("/bufferView", m))?;
                let stride = stride.unwrap_or(size);
                if stride < size {
                    return Err((
                        "/bufferView",
                        format!("its stride of {stride} is less than an element's {size} bytes"),
                    ));
                }
                Some((range(bytes, accessor.byte_offset, count, stride, size, component)?, stride))
            }
            None => {
                let zeros = accessor.count.saturating_mul(size as u64);
                document.spend_zeros(index, zeros, MAX_ZEROS).map_err(|m| ("/count", m))?;
                None
            }
        };
        view.file = accessor.buffer_view.and_then(|view| document.view_file(view));
        if let Some(sparse) = &accessor.sparse {
            if sparse.count > accessor.count {
                return Err(("/sparse/count", format!("{} of only {} elements", sparse.count, accessor.count)));
            }
            let many = sparse.count as usize;
            let code = sparse.indices.component_type.unwrap_or_default();
            let kind = Component::from_code(code).map_err(|m| ("/sparse/indices/componentType", m))?;
            let (bytes, _) =
                document.view(sparse.indices.buffer_view).map_err(|m| ("/sparse/indices/bufferView", m))?;
            let bytes = range(bytes, sparse.indices.byte_offset, many, kind.size(), kind.size(), kind)
                .map_err(|(_, m)| ("/sparse/indices", m))?;
            let indices: Vec<u32> = bytes.chunks_exact(kind.size()).take(many).map(|b| kind.read_index(b)).collect();
            let rises = indices.is_sorted_by(|a, b| a < b);
            if !rises || indices.last().is_some_and(|&i| i as usize >= count) {
                return Err(("/sparse/indices", format!("the indices have to rise and stay below {count}")));
            }
            let (bytes, _) = document.view(sparse.values.buffer_view).map_err(|m| ("/sparse/values/bufferView", m))?;
            let values = range(bytes, sparse.values.byte_offset, many, size, size, component)
                .map_err(|(_, m)| ("/sparse/values", m))?;
            view.sparse = Some((indices, values));
        }
        Ok(view)
    }

    /// Whether indices may have this type.
    pub(super) fn is_index(&self) -> bool {
        matches!(self.component, Component::U8 | Component::U16 | Component::U32)
    }

    /// How many components an element has.
    pub(super) fn components(&self) -> usize {
        self.components
    }

    /// The bytes of an element; None where it is zero.
    fn element(&self, index: usize) -> Option<&[u8]> {
        if let Some((indices, values)) = &self.sparse
            && let Ok(at) = indices.binary_search(&(index as u32))
        {
            return Some(&values[at * self.components * self.component.size()..]);
        }
        self.base.map(|(bytes, stride)| &bytes[index * stride..])
    }

    /// The element `index`, below `count`, as floats; the components that it does not have are 0.
    pub(super) fn floats<const N: usize>(&self, index: usize) -> [f32; N] {
        let Some(bytes) = self.element(index) else { return [0.0; N] };
        let size = self.component.size();
        std::array::from_fn(|k| {
            if k < self.components { self.component.read(&bytes[k * size..], self.normalized) } else { 0.0 }
        })
    }

    /// What becomes of the first `count` elements, which must be there.
    pub(super) fn collect<const N: usize, T: Send>(&self, count: usize, make: impl Fn([f32; N]) -> T + Sync) -> Vec<T> {
        let items = (0..count).into_par_iter().with_min_len(MIN_TASK).map(|i| make(self.floats(i))).collect();
        self.done();
        items
    }

    /// All elements as vectors of three floats: a copy where they are stored so.
    pub(super) fn vectors<T: Zeroable + Send>(&self, make: impl Fn([f32; 3]) -> T + Sync) -> Vec<T> {
        match self.plain(Component::F32, 3, self.count) {
            Some(records) => records.read(|bytes: &[u8; 12]| {
                let float = |k: usize| f32::from_le_bytes([bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]]);
                make([float(0), float(4), float(8)])
            }),
            None => self.collect(self.count, make),
        }
    }

    /// All indices in threes, without what is left over; for an accessor for which [`View::is_index`] holds.
    pub(super) fn triples(&self) -> Vec<[u32; 3]> {
        let count = self.count / 3;
        let packed = self.base.is_some_and(|(_, stride)| stride == 4);
        match self.plain(Component::U32, 1, count).filter(|_| packed) {
            Some(records) => Records { stride: 12, ..records }.read(|bytes: &[u8; 12]| {
                let index = |k: usize| u32::from_le_bytes([bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]]);
                [index(0), index(4), index(8)]
            }),
            None => {
                let triple = |i: usize| [self.index(3 * i), self.index(3 * i + 1), self.index(3 * i + 2)];
                let triples = (0..count).into_par_iter().with_min_len(MIN_TASK).map(triple).collect();
                self.done();
                triples
            }
        }
    }

    /// `count` elements where they are all stored, with this type.
    fn plain(&self, component: Component, components: usize, count: usize) -> Option<Records<'a>> {
        let (bytes, stride) = self.base?;
        let fits = self.component == component && self.components == components && self.sparse.is_none();
        fits.then_some(Records { file: self.file, bytes, count, stride })
    }

    fn done(&self) {
        if let (Some(file), Some((bytes, stride))) = (self.file, self.base) {
            file.done(&bytes[..(self.count * stride).min(bytes.len())]);
        }
    }

    /// The element `index`, below `count`, of an accessor for which [`View::is_index`] holds.
    pub(super) fn index(&self, index: usize) -> u32 {
        self.element(index).map_or(0, |bytes| self.component.read_index(bytes))
    }
}

/// What an accessor says of its elements.
pub(super) struct Form {
    pub(super) count: usize,
    pub(super) components: usize,
    component: Component,
    normalized: bool,
}

/// What the accessor `index` says of its elements, without a look at them.
pub(super) fn form(document: &Document<'_>, index: usize) -> Result<Form> {
    View::told(document, index, |accessor| {
        let View { count, components, component, normalized, .. } =
            View::typed(accessor, &["SCALAR", "VEC2", "VEC3", "VEC4"])?;
        Ok(Form { count, components, component, normalized })
    })
}

impl Form {
    /// What a component stands for that is stored as `value`.
    pub(super) fn value(&self, value: f32) -> f32 {
        self.component.value(value, self.normalized)
    }
}

/// The bytes of a view from `offset`, where `count` elements lie `stride` apart.
fn range(
    bytes: &[u8],
    offset: u64,
    count: usize,
    stride: usize,
    size: usize,
    component: Component,
) -> std::result::Result<&[u8], Fault> {
    if !offset.is_multiple_of(component.size() as u64) || !stride.is_multiple_of(component.size()) {
        let message =
            format!("offset {offset} or stride {stride} is no multiple of the component's {}", component.size());
        return Err(("/byteOffset", message));
    }
    let needed = match count {
        0 => 0,
        _ => (count as u128 - 1) * stride as u128 + size as u128,
    };
    if u128::from(offset) + needed > bytes.len() as u128 {
        let message =
            format!("{count} elements from byte {offset} on take {needed} bytes, past the view's {}", bytes.len());
        return Err(("/count", message));
    }
    // In range: both are at most the view's length, or there is nothing to read.
    Ok(bytes.get(offset as usize..).unwrap_or_default())
}
