//! The farm's wire protocol: generated messages and services, and how a connection is made.

pub mod connect;
pub mod dns;
pub mod json;

/// Messages and services of `farm.proto`; documented there.
#[allow(missing_docs, clippy::all, clippy::unwrap_used)]
mod generated {
    tonic::include_proto!("lightfarm.v1");
}

pub use generated::*;

/// Version of the protocol, and of the plans and results that it carries; peers of another version are refused.
pub const PROTOCOL: u32 = 2;
/// Bytes of data in one message of a bulk stream.
pub const CHUNK: usize = 256 << 10;
