//! Memory that this process may still have, and large buffers that do not fit it.

use std::cell::Cell;
use std::sync::Mutex;

use sysinfo::{ProcessRefreshKind, ProcessesToUpdate, System};

thread_local! {
    /// True if the allocation that this thread asks for may be refused.
    static MAY_FAIL: Cell<bool> = const { Cell::new(false) };
}

/// True if the allocation that this thread asks for may be refused, since the caller turns a refusal
/// into an [`OutOfMemory`]. All others cannot go on without it.
pub fn may_fail() -> bool {
    MAY_FAIL.get()
}

/// Bytes of memory that this process may still have; `None` where the system does not say.
///
/// The least of: memory that is free on the machine, the rest of the process's control group (a
/// container's limit, cgroup v1 or v2; file caches count as free), and the rest of its address space
/// (`ulimit -v`).
pub(crate) fn available_memory() -> Option<u64> {
    let mut system = System::new().ok()?;
    system.refresh_memory();
    let machine = Some(system.available_memory()).filter(|&bytes| bytes > 0);
    let pid = sysinfo::get_current_pid().ok();
    let own: Vec<_> = pid.into_iter().collect();
    let memory = ProcessRefreshKind::nothing().with_memory();
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&own), false, memory);
    let process = pid.and_then(|pid| system.process(pid));
    let group = process.and_then(|process| process.cgroup_limits());
    let group = group.map(|limits| limits.total_memory.saturating_sub(limits.rss));
    let addresses = address_space().zip(process);
    let addresses = addresses.map(|(limit, own)| limit.saturating_sub(own.virtual_memory()));
    [machine, group, addresses].into_iter().flatten().min()
}

/// Bytes of addresses that this process may use, if they are limited.
#[cfg(unix)]
fn address_space() -> Option<u64> {
    rustix::process::getrlimit(rustix::process::Resource::As).current
}

#[cfg(not(unix))]
fn address_space() -> Option<u64> {
    None
}

/// Memory that this process may not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "out of memory: {what} need {} MiB and {} MiB are left to this process; raise its limit, or use fewer \
     placements at once, fewer frames or beams, larger voxels or a coarser mesh", *.need >> 20, *.left >> 20
)]
pub struct OutOfMemory {
    /// Contents of the memory, in the plural.
    pub what: &'static str,
    /// Bytes needed.
    pub need: u64,
    /// Bytes that this process may still have; 0 where the system does not say.
    pub left: u64,
}

/// Checks that `need` bytes are left.
///
/// # Errors
/// Fewer are left.
pub fn check(what: &'static str, need: u64) -> Result<(), OutOfMemory> {
    match available_memory() {
        Some(left) if left < need => Err(OutOfMemory { what, need, left }),
        _ => Ok(()),
    }
}

/// Makes room for `len` elements in all.
pub fn reserve<T>(vec: &mut Vec<T>, len: usize, what: &'static str) -> Result<(), OutOfMemory> {
    let more = len.saturating_sub(vec.len());
    MAY_FAIL.set(true);
    let reserved = vec.try_reserve_exact(more);
    MAY_FAIL.set(false);
    reserved.map_err(|_| {
        let need = (len as u64).saturating_mul(size_of::<T>() as u64);
        OutOfMemory { what, need, left: available_memory().unwrap_or(0) }
    })
}

/// An empty vector with room for `len` elements.
pub fn room<T>(len: usize, what: &'static str) -> Result<Vec<T>, OutOfMemory> {
    let mut vec = Vec::new();
    reserve(&mut vec, len, what)?;
    Ok(vec)
}

/// `len` zeros.
pub fn zeros<T: Clone + Default>(len: usize, what: &'static str) -> Result<Vec<T>, OutOfMemory> {
    let mut vec = room(len, what)?;
    vec.resize(len, T::default());
    Ok(vec)
}

/// Working memory of tasks, to be used again.
#[derive(Default)]
pub(crate) struct FreeList<T>(Mutex<Vec<T>>);

impl<T: Default> FreeList<T> {
    pub(crate) fn take(&self) -> T {
        self.0.lock().ok().and_then(|mut kept| kept.pop()).unwrap_or_default()
    }

    pub(crate) fn put_back(&self, memory: T) {
        if let Ok(mut kept) = self.0.lock() {
            kept.push(memory);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_beyond_all_memory_are_errors() {
        let error = zeros::<u64>(1 << 58, "bitmaps").unwrap_err();
        assert_eq!((error.what, error.need), ("bitmaps", 1 << 61));
        assert!(error.to_string().starts_with("out of memory: bitmaps need 2199023255552 MiB"));
        let error = check("trees", u64::MAX).unwrap_err();
        assert!(error.left > 0 && error.left < 1 << 50, "{error}");
        assert_eq!(zeros::<u64>(3, "bitmaps").unwrap(), [0; 3]);
        check("trees", 1).unwrap();
    }
}
