//! Hostile input: whatever a glTF or picture file holds, it loads or gives an error, in bounded time and memory.

// A counting allocator can't be written without it: `GlobalAlloc` is an unsafe trait.
#![allow(unsafe_code)]
// All of it is a test: helpers fail it as tests do.
#![allow(clippy::panic, clippy::unwrap_used)]

mod corpus;
mod guard;
mod mutation;
mod whole;
