//! Memory that this process may still have.

use sysinfo::{ProcessRefreshKind, ProcessesToUpdate, System};

/// Bytes of memory that this process may still have; `None` where the system does not say.
///
/// The least of: memory that is free on the machine, the rest of the process's control group (a
/// container's limit, cgroup v1 or v2; file caches count as free), and the rest of its address space
/// (`ulimit -v`).
pub fn available_memory() -> Option<u64> {
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
