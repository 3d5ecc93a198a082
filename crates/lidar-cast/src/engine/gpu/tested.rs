//! Devices that answered the table of arithmetic: only such are used.

use std::collections::HashMap;
use std::sync::Mutex;

use serde::Serialize;

use super::adapters::{AdapterSummary, instance, ranked_adapters, summary};
use super::device::Device;
use super::kernels::Kernels;
use super::layout::WORKGROUP_SIZE;
use super::self_test::{NO_CASE, SelfTest, cases, judge};
use crate::engine::BackendError;

/// A device, and how it computes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TestedAdapter {
    /// Device facts from its driver. `auto` stays true only if the self-test passed.
    #[serde(flatten)]
    pub summary: AdapterSummary,
    /// Its answers to a table of arithmetic; none where it could not be asked.
    pub self_test: Option<SelfTest>,
    /// Why it is not used, if it is not.
    pub refused: Option<String>,
}

/// Every Vulkan device of this machine, best first, each opened and asked to compute a table of arithmetic.
pub fn test_adapters() -> Vec<TestedAdapter> {
    let ranked = ranked_adapters(&instance());
    let tested = ranked.iter().enumerate().map(|(index, adapter)| {
        let mut summary = summary(index, adapter);
        let (self_test, refused) = match Device::of(adapter).and_then(|device| self_test(&device)) {
            Ok(result) => {
                let complaint = result.complaint();
                (Some(result), complaint)
            }
            Err(error) => (None, Some(error.to_string())),
        };
        summary.auto &= refused.is_none();
        TestedAdapter { summary, self_test, refused }
    });
    tested.collect()
}

/// Opens the best device, or the one whose name contains `name`.
///
/// # Errors
/// No such device, or one that does not keep the bits that the kernels need.
pub(super) fn open(name: Option<&str>) -> Result<Device, BackendError> {
    let device = Device::open(name)?;
    match self_test(&device)?.complaint() {
        Some(complaint) => Err(device.failed("being opened", complaint)),
        None => Ok(device),
    }
}

/// Runs the table on a device.
fn run(device: &Device) -> Result<SelfTest, BackendError> {
    let cases = cases();
    let count = cases.len().next_multiple_of(WORKGROUP_SIZE as usize);
    let padded = cases.iter().chain(std::iter::repeat(&NO_CASE)).take(count);
    let words: Vec<[u32; 5]> =
        padded.map(|&(operation, [a, b, c])| [operation as u32, a, b, c, 0]).collect();
    let kernels = Kernels::new();
    kernels.compile(device, |kernel| kernel == "self_test");
    device.check("compiling its self-test")?;
    let table = device.upload("cases", &words)?;
    let usage =
        wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
    let answers = device.buffer("answers", 4 * count as u64, usage)?;
    // An answer that is never written is no right one.
    device.write(&answers, &vec![u32::MAX; count]);
    let record = |encoder: &mut wgpu::CommandEncoder| {
        let groups = [count as u32 / WORKGROUP_SIZE, 1, 1];
        kernels.dispatch(device, encoder, "self_test", &[&table, &answers], groups);
    };
    let reading = device.start("its self-test", record, &[(&answers, 4 * count as u64)])?;
    device.finish(reading, |parts| judge(&cases, bytemuck::cast_slice(parts[0])))
}

/// Results by device name and driver: a device is asked once in the life of the program.
static KNOWN: Mutex<Option<HashMap<String, SelfTest>>> = Mutex::new(None);

/// The device's answers.
///
/// # Errors
/// A device that fails to compile or run the table.
fn self_test(device: &Device) -> Result<SelfTest, BackendError> {
    let name = device.adapter().to_owned();
    let known = |known: &Option<HashMap<String, SelfTest>>| known.as_ref()?.get(&name).cloned();
    if let Some(result) = KNOWN.lock().ok().and_then(|table| known(&table)) {
        return Ok(result);
    }
    let result = run(device)?;
    if let Ok(mut table) = KNOWN.lock() {
        table.get_or_insert_default().insert(name, result.clone());
    }
    Ok(result)
}
