//! Running out of memory ends the program with a sentence: Rust's own handler aborts.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;

use crate::memory::may_fail;

/// The system's allocator; where it refuses memory that nobody can do without, the process says so and
/// exits with code 2, as after any other error.
pub struct Sentence;

// SAFETY: every call goes to `System` unchanged, and its answer is returned unchanged.
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

/// Prints the refused size and ends the program; takes no memory.
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
