//! Memory that geometry is read from: the library's own or the caller's.

use std::alloc::{Layout, alloc_zeroed, dealloc};
use std::sync::Arc;

use crate::abi::format;
use crate::device::Device;
use crate::failure::{Code, Failure, Result};

/// A buffer.
pub struct Buffer {
    pub device: Arc<Device>,
    data: *mut u8,
    bytes: usize,
    /// Of the library's own memory.
    layout: Option<Layout>,
}

// SAFETY: the memory is written by the caller and read while a scene is committed; that these do not meet is the
// interface's rule.
unsafe impl Send for Buffer {}
// SAFETY: as above.
unsafe impl Sync for Buffer {}

/// Callers may read a whole vector at the last item.
const PADDING: usize = 16;

impl Buffer {
    /// Of `bytes` zeros; without memory where there are none.
    pub fn new(device: Arc<Device>, bytes: usize) -> Result<Self> {
        if bytes == 0 {
            return Ok(Self::shared(device, std::ptr::null_mut(), 0));
        }
        let exhausted = || Failure { code: Code::OutOfMemory, message: format!("a buffer of {bytes} bytes") };
        let padded = bytes.checked_add(PADDING).ok_or_else(exhausted)?;
        let layout = Layout::from_size_align(padded, 64).map_err(|_| exhausted())?;
        device.account(bytes as isize, false)?;
        // SAFETY: the size is not zero.
        let data = unsafe { alloc_zeroed(layout) };
        if data.is_null() {
            // What the monitor was told of is not taken.
            device.account(-(bytes as isize), true)?;
            return Err(exhausted());
        }
        Ok(Self { device, data, bytes, layout: Some(layout) })
    }

    /// Over the caller's memory.
    pub fn shared(device: Arc<Device>, data: *mut u8, bytes: usize) -> Self {
        Self { device, data, bytes, layout: None }
    }

    pub fn data(&self) -> *mut u8 {
        self.data
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if let Some(layout) = self.layout {
            // SAFETY: allocated with this layout in `new`, and given back once.
            unsafe { dealloc(self.data, layout) };
            // Giving back is never refused.
            _ = self.device.account(-(self.bytes as isize), true);
        }
    }
}

/// Where items are in a buffer.
#[derive(Clone, Copy, Debug)]
pub struct Items {
    pub format: u32,
    pub offset: usize,
    /// Bytes from one item to the next.
    pub stride: usize,
    pub count: usize,
}

impl Items {
    /// Where the last item ends. What comes after it up to the next one's place, such as other data of an interleaved
    /// buffer, is not there.
    pub fn end(&self) -> Result<usize> {
        let Some(before) = self.count.checked_sub(1) else { return Ok(0) };
        let last = self.stride.checked_mul(before).and_then(|bytes| bytes.checked_add(self.offset));
        let end = last.and_then(|bytes| bytes.checked_add(format::bytes(self.format)));
        end.ok_or_else(|| Failure::argument("buffer range out of bounds"))
    }

    /// Whether items of words are where words may be, in a buffer that begins at an address.
    pub fn is_aligned(&self, address: usize) -> bool {
        address.wrapping_add(self.offset).is_multiple_of(4) && self.stride.is_multiple_of(4)
    }
}

/// A buffer and the items in it.
#[derive(Clone)]
pub struct View {
    buffer: Arc<Buffer>,
    items: Items,
    /// Of an item, by its format.
    item_bytes: usize,
}

impl View {
    /// Items that lie in a buffer.
    pub fn new(buffer: Arc<Buffer>, items: Items) -> Result<Self> {
        if items.end()? > buffer.bytes {
            return Err(Failure::argument("buffer range out of bounds"));
        }
        if buffer.data.is_null() && items.count > 0 {
            return Err(Failure::argument("invalid argument"));
        }
        Ok(Self { buffer, items, item_bytes: format::bytes(items.format) })
    }

    /// Where the first item is; null in a buffer without bytes.
    pub fn data(&self) -> *mut u8 {
        let data = self.buffer.data;
        if data.is_null() { data } else { data.wrapping_add(self.items.offset) }
    }

    pub fn format(&self) -> u32 {
        self.items.format
    }

    pub fn stride(&self) -> usize {
        self.items.stride
    }

    pub fn count(&self) -> usize {
        self.items.count
    }

    /// Where item `index` is; none where there is no such item, or where items are of fewer bytes than these.
    #[inline]
    fn item(&self, index: usize, bytes: usize) -> Option<*const u8> {
        let is_there = index < self.count() && bytes <= self.item_bytes;
        is_there.then(|| self.data().wrapping_add(index * self.stride()).cast_const())
    }

    /// The first words of item `index`, which may not be there.
    #[inline]
    pub fn words<const N: usize>(&self, index: usize) -> Option<[u32; N]> {
        let item = self.item(index, 4 * N)?;
        // SAFETY: the item has that many bytes, and lies in the buffer, which the caller promised to be so large, and
        // alive.
        Some(unsafe { item.cast::<[u32; N]>().read_unaligned() })
    }

    /// The same as numbers.
    #[inline]
    pub fn floats<const N: usize>(&self, index: usize) -> Option<[f32; N]> {
        self.words(index).map(|words| words.map(f32::from_bits))
    }

    /// The first byte of item `index`.
    pub fn byte(&self, index: usize) -> Option<u8> {
        let item = self.item(index, 1)?;
        // SAFETY: as in `words`.
        Some(unsafe { item.read() })
    }
}
