//! Memory in huge pages for what is read all over the place: a tree of a million triangles is larger than what the processor can
//! translate addresses of at once.

/// An empty vector with room for `count` elements, in huge pages where the system gives them on request.
pub(super) fn with_capacity<T>(count: usize) -> Vec<T> {
    let mut memory = Vec::with_capacity(count);
    advise(memory.spare_capacity_mut());
    memory
}

/// Smallest memory for which it pays.
#[cfg(target_os = "linux")]
const LEAST: usize = 4 << 20;

#[cfg(target_os = "linux")]
fn advise<T>(memory: &mut [std::mem::MaybeUninit<T>]) {
    let (start, bytes) = (memory.as_mut_ptr() as usize, size_of_val(memory));
    // SAFETY: advice changes no contents. The whole pages inside the slice are passed, at an address that is a multiple of the size of
    // any page.
    #[allow(unsafe_code, reason = "the only way to ask for huge pages")]
    if bytes >= LEAST {
        let first = start.next_multiple_of(1 << 16);
        unsafe {
            libc::madvise(first as *mut libc::c_void, start + bytes - first, libc::MADV_HUGEPAGE);
        }
    }
}

#[cfg(not(target_os = "linux"))]
fn advise<T>(_: &mut [std::mem::MaybeUninit<T>]) {}
