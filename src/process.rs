//! The process: an allocator that says how it ran out of memory, and the number of threads.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;

use crate::memory::may_fail;

/// The system's allocator; where it refuses memory that nobody can do without, the process says so and
/// exits with code 2, as after any other error.
pub struct Sentence;

// SAFETY: every call goes to `System` as it is, and what `System` returns is returned as it is.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Sentence {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `alloc`.
        given(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        given(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `realloc`.
        given(unsafe { System.realloc(old, layout, size) }, size)
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// `memory`, unless it was refused to a caller that cannot go on.
#[inline]
fn given(memory: *mut u8, size: usize) -> *mut u8 {
    if memory.is_null() && !may_fail() {
        give_up(size);
    }
    memory
}

/// Says what was refused and ends the program; takes no memory.
#[cold]
fn give_up(size: usize) -> ! {
    // Nobody is left to tell where even this fails.
    let _ = writeln!(
        std::io::stderr(),
        "sightline: out of memory: another {size} bytes were refused to this process; raise its limit \
         (`ulimit -v`, the container's), or use fewer frames, larger voxels or a coarser mesh"
    );
    std::process::exit(2)
}

/// Threads for each core that are still useful.
const A_CORE: usize = 4;
/// Threads that any machine may be asked for.
const ANY_MACHINE: usize = 16;
/// Variables that rayon takes the number of its threads from.
const VARIABLES: [&str; 2] = ["RAYON_NUM_THREADS", "RAYON_RS_NUM_CPUS"];

/// Most threads that this machine is given: four a core, and at least 16.
pub fn most() -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    (A_CORE * cores).max(ANY_MACHINE)
}

/// Starts so many threads, at most [`most`], for all work to come, and returns their number.
///
/// # Errors
/// Threads that were started before, or that the system does not give.
pub fn start(wanted: usize) -> Result<usize, rayon::ThreadPoolBuildError> {
    let threads = wanted.clamp(1, most());
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    Ok(threads)
}

/// Number of threads that the environment asks for, where it is more than [`most`].
pub fn too_many_by_environment() -> Option<usize> {
    let number = |name: &&str| std::env::var(name).ok()?.parse::<usize>().ok();
    VARIABLES.iter().find_map(number).filter(|&wanted| wanted > most())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_machine_gets_more_threads_than_are_useful() {
        assert!((16..65_535).contains(&most()));
        assert!(start(65_535).is_ok_and(|threads| threads == most()) || start(1).is_err());
    }
}
