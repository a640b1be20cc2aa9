//! Zeroed matrices whose memory all threads touch first.

use faer::Mat;
use rayon::prelude::*;
use std::mem::MaybeUninit;

/// Zeros, n × m, whose memory the threads of the current rayon pool touch first: the system hands
/// it out page by page, which takes one thread longer than most steps of a preparation.
pub fn zeros<T: Copy + Default + Send>(n: usize, m: usize) -> Mat<T> {
    const TASK_BYTES: usize = 1 << 18;
    let mut matrix = Mat::<T>::with_capacity(n, m);
    let stride = matrix.col_stride().unsigned_abs();
    let length = if n == 0 { 0 } else { stride * m };
    // SAFETY: a matrix of this capacity owns m columns of `stride` ≥ n entries each.
    #[allow(unsafe_code)]
    let entries = unsafe { std::slice::from_raw_parts_mut(matrix.as_ptr_mut().cast::<MaybeUninit<T>>(), length) };
    entries.par_chunks_mut(TASK_BYTES / size_of::<T>()).for_each(|part| part.fill(MaybeUninit::new(T::default())));
    // SAFETY: within the capacity, and every entry was written just now.
    #[allow(unsafe_code)]
    unsafe {
        matrix.set_dims(n, m);
    }
    matrix
}
