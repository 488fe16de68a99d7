//! How a command fails, and the exit status that says so.

use std::fmt;

/// Shown under `--help`.
pub const HELP: &str =
    "exit status: 0 done, 1 the input or job is at fault, 2 usage, 3 the farm or machine is at fault,
130 interrupted (what was finished is saved)";

/// Why a command did not do what it was asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The scene, picture or job is at fault.
    Input(String),
    /// The command line is at fault.
    Usage(String),
    /// The farm, the disk or another part of a machine is at fault.
    Machine(String),
    /// A signal ended it; what was finished is saved.
    Interrupted,
}

impl Failure {
    /// The process's exit status.
    pub fn status(&self) -> u8 {
        match self {
            Self::Input(_) => 1,
            Self::Usage(_) => 2,
            Self::Machine(_) => 3,
            Self::Interrupted => 130,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(m) | Self::Usage(m) | Self::Machine(m) => f.write_str(m),
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}

/// What a command returns.
pub type Outcome = Result<(), Failure>;
