//! The shim's interface: the types of `ffi/oiio/shim.h`, and its functions as Rust has them.
//!
//! The crate cxx would write this file, but what it makes is linked into the program, and OpenImageIO with it.
#![allow(unsafe_code, reason = "calls of the shim's functions, and slices of its memory")]

use std::marker::PhantomData;
use std::path::Path;
use std::ptr;

/// What has no value of its own fails with words alone.
pub(super) type Result<T> = std::result::Result<T, String>;

/// A slice as C++ has it. Either made of a Rust slice, or filled in by the shim with memory that lives for `'a`.
#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct Slice<'a, T> {
    data: *const T,
    length: usize,
    of: PhantomData<&'a [T]>,
}

pub(super) type Bytes<'a> = Slice<'a, u8>;

impl<'a, T> Slice<'a, T> {
    const EMPTY: Self = Self { data: ptr::null(), length: 0, of: PhantomData };

    pub(super) fn get(self) -> &'a [T] {
        if self.length == 0 {
            return &[];
        }
        // SAFETY: so many values are there for 'a: of a Rust slice by `from`, of the shim's by the comments in its
        // header.
        unsafe { std::slice::from_raw_parts(self.data, self.length) }
    }
}

impl<'a, T> From<&'a [T]> for Slice<'a, T> {
    fn from(slice: &'a [T]) -> Self {
        Self { data: slice.as_ptr(), length: slice.len(), of: PhantomData }
    }
}

impl<'a> From<&'a str> for Bytes<'a> {
    fn from(text: &'a str) -> Self {
        text.as_bytes().into()
    }
}

impl<T> Default for Slice<'_, T> {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Bytes<'_> {
    /// Lossy: a file may hold any bytes.
    pub(super) fn text(self) -> String {
        String::from_utf8_lossy(self.get()).into_owned()
    }
}

/// The type of a sample.
#[repr(u32)]
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Kind {
    #[default]
    U8,
    U16,
    U32,
    Half,
    Float,
}

/// One of the channels of a file.
#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct Named<'a> {
    pub(super) name: Bytes<'a>,
    pub(super) kind: Kind,
}

/// An attribute.
#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct Text<'a> {
    pub(super) name: Bytes<'a>,
    pub(super) value: Bytes<'a>,
}

/// What a file holds.
#[repr(C)]
#[derive(Default)]
pub(super) struct Layout<'a> {
    pub(super) width: u32,
    pub(super) height: u32,
    /// 1 to 4: gray or RGB, then alpha.
    pub(super) channels: u32,
    pub(super) kind: Kind,
    /// Edge of a tile; 0 for rows.
    pub(super) tile: u32,
    /// Whether the last channel is alpha, and if so, whether colours are not multiplied by it.
    pub(super) alpha: bool,
    pub(super) straight: bool,
    /// Whether codes are written without a transfer function; of what is read nothing is said.
    pub(super) linear: bool,
    /// What follows the colours in each pixel, of four bytes each.
    pub(super) beside: Slice<'a, Named<'a>>,
    /// Of what is read: how it has to be turned to be seen, 1 to 8 as EXIF counts.
    pub(super) orientation: u32,
    /// Of what is read: its x and y, and x, y, width and height of the picture that it is a part of.
    pub(super) window: [i32; 6],
}

/// Attributes, as far as they are there: of 0 or 1 value, matrices of 0 or 16.
#[repr(C)]
#[derive(Default)]
pub(super) struct Attributes<'a> {
    pub(super) software: Bytes<'a>,
    pub(super) world_to_camera: Slice<'a, f32>,
    pub(super) world_to_screen: Slice<'a, f32>,
    pub(super) fovcot: Slice<'a, f32>,
    pub(super) samples_per_pixel: Slice<'a, i32>,
    pub(super) render_time_seconds: Slice<'a, f32>,
    /// x, y, and the width and height of the whole picture; or nothing.
    pub(super) window: Slice<'a, i32>,
    pub(super) texts: Slice<'a, Text<'a>>,
}

/// Words, or null where all went well.
type Failure = Bytes<'static>;

/// A file of the shim's.
#[repr(C)]
struct File {
    _its_own: [u8; 0],
}

/// The shim's functions. Each reads what it is given during the call alone, keeps none of it, and lets no exception
/// out.
#[repr(C)]
#[derive(Debug)]
pub(super) struct Functions {
    suffixes: unsafe extern "C" fn(*mut Bytes<'_>) -> Failure,
    write: unsafe extern "C" fn(Bytes<'_>, *const Layout<'_>, *const Attributes<'_>, Bytes<'_>) -> Failure,
    open: unsafe extern "C" fn(Bytes<'_>, Bytes<'_>, *mut *mut File) -> Failure,
    close: unsafe extern "C" fn(*mut File),
    size: unsafe extern "C" fn(*const File, *mut [u32; 2]) -> Failure,
    layout: unsafe extern "C" fn(*const File, *mut Layout<'_>) -> Failure,
    attributes: unsafe extern "C" fn(*mut File, *mut Attributes<'_>) -> Failure,
    read: unsafe extern "C" fn(*mut File, *mut u8, usize) -> Failure,
    channels: unsafe extern "C" fn(*mut File, *mut Slice<'_, Named<'_>>) -> Failure,
    read_all: unsafe extern "C" fn(*mut File, *mut u8, usize) -> Failure,
}

impl Functions {
    /// Suffixes of the formats that can be written, with commas between.
    pub(super) fn suffixes(&self) -> Result<String> {
        let mut suffixes = Bytes::EMPTY;
        // SAFETY: the shim fills it in with bytes that last until this thread's next call.
        result(unsafe { (self.suffixes)(&raw mut suffixes) })?;
        Ok(suffixes.text())
    }

    pub(super) fn write(&self, path: &Path, layout: &Layout, attributes: &Attributes, samples: &[u8]) -> Result<()> {
        // SAFETY: all of it is there during the call; the shim checks that there are as many samples as the layout
        // says.
        result(unsafe { (self.write)(bytes(path), layout, attributes, samples.into()) })
    }

    /// Opens a file by the reader of a format, which is told by its name or by a suffix of its files.
    pub(super) fn open(&self, path: &Path, format: &str) -> Result<Input<'_>> {
        let mut file = ptr::null_mut();
        // SAFETY: the shim reads the names during the call, and fills in a file of its own.
        result(unsafe { (self.open)(bytes(path), format.into(), &raw mut file) })?;
        Ok(Input { functions: self, file })
    }
}

/// A file opened for reading.
pub(super) struct Input<'f> {
    functions: &'f Functions,
    /// Open until it is dropped.
    file: *mut File,
}

impl Input<'_> {
    /// Width and height.
    pub(super) fn size(&self) -> Result<[u32; 2]> {
        let mut size = [0; 2];
        // SAFETY: the file is open, and the shim fills in two numbers.
        result(unsafe { (self.functions.size)(self.file, &raw mut size) })?;
        Ok(size)
    }

    /// Of the colours; an error where there are none.
    pub(super) fn layout(&self) -> Result<Layout<'static>> {
        let mut layout = Layout::default();
        // SAFETY: the file is open, and of slices the shim fills in none.
        result(unsafe { (self.functions.layout)(self.file, &raw mut layout) })?;
        Ok(layout)
    }

    pub(super) fn attributes(&mut self) -> Result<Attributes<'_>> {
        let mut attributes = Attributes::default();
        // SAFETY: the file is open. What is filled in lasts until its next call, and so long it is borrowed here.
        result(unsafe { (self.functions.attributes)(self.file, &raw mut attributes) })?;
        Ok(attributes)
    }

    /// Reads all samples of the colours.
    pub(super) fn read(&mut self, samples: &mut [u8]) -> Result<()> {
        // SAFETY: the file is open, and the shim checks that it has as many samples.
        result(unsafe { (self.functions.read)(self.file, samples.as_mut_ptr(), samples.len()) })
    }

    /// Every channel, in the order of the file.
    pub(super) fn channels(&mut self) -> Result<&[Named<'_>]> {
        let mut channels = Slice::EMPTY;
        // SAFETY: as of attributes.
        result(unsafe { (self.functions.channels)(self.file, &raw mut channels) })?;
        Ok(channels.get())
    }

    /// Reads all samples of all channels, side by side as they are in the file.
    pub(super) fn read_all(&mut self, samples: &mut [u8]) -> Result<()> {
        // SAFETY: as of read.
        result(unsafe { (self.functions.read_all)(self.file, samples.as_mut_ptr(), samples.len()) })
    }
}

impl Drop for Input<'_> {
    fn drop(&mut self) {
        // SAFETY: the file is open, and nobody can name it any more.
        unsafe { (self.functions.close)(self.file) };
    }
}

/// On Unix a path is bytes to OpenImageIO, too.
fn bytes(path: &Path) -> Bytes<'_> {
    path.as_os_str().as_encoded_bytes().into()
}

fn result(failure: Failure) -> Result<()> {
    if failure.data.is_null() {
        return Ok(());
    }
    // One line: some of OpenImageIO's messages have several.
    Err(failure.text().split('\n').map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; "))
}
