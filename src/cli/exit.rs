//! How a command ended, as a shell sees it.

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// All that was asked.
    Done,
    /// With a check that failed.
    CheckFailed,
    /// At an input or an argument that is wrong; stderr holds one sentence about it.
    BadInput,
    /// By Ctrl-C, after what was done so far was written.
    Interrupted,
}

impl Exit {
    /// The exit code: 0, 1, 2 or 130, as shells expect of an interrupted program.
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::CheckFailed => 1,
            Self::BadInput => 2,
            Self::Interrupted => 130,
        }
    }
}
