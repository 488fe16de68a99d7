//! Names of things: newtypes, so that one can't be taken for another.

use std::fmt;
use uuid::Uuid;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub Uuid);

        impl $name {
            /// From 16 bytes.
            pub fn from_slice(bytes: &[u8]) -> Option<Self> {
                Uuid::from_slice(bytes).ok().map(Self)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.hyphenated().fmt(f)
            }
        }
    };
}

id! {
    /// A job, named by the client that submitted it.
    JobId
}
id! {
    /// A worker process, from its start to its end.
    WorkerId
}

/// A lease's fencing token: unique and growing over the whole life of a data folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Epoch(pub u64);

/// Makes epochs. Each start of the coordinator has a generation of its own, stored before the first lease.
#[derive(Debug)]
pub struct Epochs {
    next: u64,
}

impl Epochs {
    /// For the given start of the coordinator, counted from 1: each has room for 2^32 leases.
    pub fn of_generation(generation: u32) -> Self {
        Self { next: u64::from(generation) << 32 }
    }

    /// One that was never given out before.
    pub fn fresh(&mut self) -> Epoch {
        self.next += 1;
        Epoch(self.next)
    }
}
