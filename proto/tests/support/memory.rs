//! An allocator that counts: how much memory something takes.

// The interface of allocators is unsafe; not every test asks everything.
#![allow(unsafe_code, dead_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicIsize, Ordering::Relaxed};

static LIVE: AtomicIsize = AtomicIsize::new(0);
static PEAK: AtomicIsize = AtomicIsize::new(0);

thread_local! {
    static LIVE_HERE: Cell<isize> = const { Cell::new(0) };
    static PEAK_HERE: Cell<isize> = const { Cell::new(0) };
}

/// What `f` gives, and the most bytes of the heap that were held at one time beside what was held before, on any thread. Whatever else goes on in the
/// process counts too.
pub(crate) fn peak_of_all_threads<T>(f: impl FnOnce() -> T) -> (T, usize) {
    let before = LIVE.load(Relaxed);
    PEAK.store(before, Relaxed);
    let value = f();
    (value, usize::try_from(PEAK.load(Relaxed) - before).unwrap_or(0))
}

/// As [`peak_of_all_threads`], on this thread alone: others may go on beside it.
pub(crate) fn peak_of<T>(f: impl FnOnce() -> T) -> (T, usize) {
    let before = LIVE_HERE.get();
    PEAK_HERE.set(before);
    let value = f();
    (value, usize::try_from(PEAK_HERE.get() - before).unwrap_or(0))
}

struct Counting;

fn count(bytes: isize) {
    let live = LIVE.fetch_add(bytes, Relaxed) + bytes;
    LIVE_HERE.set(LIVE_HERE.get() + bytes);
    if bytes > 0 {
        PEAK.fetch_max(live, Relaxed);
        PEAK_HERE.set(PEAK_HERE.get().max(LIVE_HERE.get()));
    }
}

// SAFETY: everything is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;
