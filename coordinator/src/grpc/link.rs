//! Connections that tell the farm when they end. A waiting call is dropped with its connection, but a worker that dies between two
//! calls has none waiting: without this its units would be held until their lease runs out.

use crate::hub::Hub;
use crate::ids::WorkerId;
use std::collections::BTreeMap;
use std::io::{self, IoSlice};
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tonic::transport::server::Connected;

/// Who called over a connection; the services find it among a request's extensions.
#[derive(Clone, Debug)]
pub struct Link {
    /// Where it comes from.
    pub address: Option<SocketAddr>,
    /// The last call of each worker.
    calls: Arc<Mutex<BTreeMap<WorkerId, u64>>>,
}

impl Link {
    /// Call `sequence` of `worker` came over this connection.
    pub fn note(&self, worker: WorkerId, sequence: u64) {
        let mut calls = self.calls.lock().unwrap_or_else(PoisonError::into_inner);
        let last = calls.entry(worker).or_default();
        *last = sequence.max(*last);
    }
}

/// A connection.
pub struct Linked {
    stream: TcpStream,
    link: Link,
    hub: Arc<Hub>,
}

impl Linked {
    /// A connection that has just been accepted.
    pub fn new(stream: TcpStream, hub: Arc<Hub>) -> Self {
        let link = Link { address: stream.peer_addr().ok(), calls: Arc::default() };
        Self { stream, link, hub }
    }
}

impl Drop for Linked {
    fn drop(&mut self) {
        let calls = std::mem::take(&mut *self.link.calls.lock().unwrap_or_else(PoisonError::into_inner));
        // Who has called since over another connection is there, and its later call is the one that counts.
        for (worker, sequence) in calls {
            self.hub.with(|farm, now| farm.disconnected(worker, sequence, now));
        }
    }
}

impl Connected for Linked {
    type ConnectInfo = Link;

    fn connect_info(&self) -> Link {
        self.link.clone()
    }
}

impl AsyncRead for Linked {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(cx, buf)
    }
}

impl AsyncWrite for Linked {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(cx, buf)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bufs: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(cx, bufs)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

#[cfg(test)]
#[path = "link_tests.rs"]
mod tests;
