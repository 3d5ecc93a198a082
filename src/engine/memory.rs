//! Memory that this process may still have.

/// Bytes of memory that are free for use on this machine, as the system estimates it; `None` where the
/// system does not say.
pub fn available_memory() -> Option<u64> {
    let mut system = sysinfo::System::new().ok()?;
    system.refresh_memory();
    Some(system.available_memory()).filter(|&bytes| bytes > 0)
}
