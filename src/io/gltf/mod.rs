//! glTF
use crate::{
    Scene,
    error::{Result, Warning},
};
use std::path::Path;
pub(super) fn load(_path: &Path, _bytes: &[u8], _warnings: &mut Vec<Warning>) -> Result<Scene> {
    todo!()
}
