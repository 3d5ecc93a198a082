//! Echoes of one pulse.

use super::Status;
use super::rays::RAYS;

/// Power that comes back from one distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Echo {
    /// Metres.
    pub range: f64,
    /// Power in the unit of ρ·cos θ / r².
    pub power: f64,
    /// The beam's ray that brings most of it back from a surface; `None` of the medium.
    pub ray: Option<u8>,
    pub status: Status,
}

impl Echo {
    const NONE: Self = Self { range: 0.0, power: 0.0, ray: None, status: Status::Miss };

    /// Echo of fog, snow or rain.
    pub fn of_medium(range: f64, power: f64, status: Status) -> Self {
        Self { range, power, ray: None, status }
    }

    /// Adds the power of another, and moves to the mean of both by power.
    pub fn join(&mut self, other: &Self) {
        let power = self.power + other.power;
        let share = if power > 0.0 { other.power / power } else { 0.0 };
        self.range += share * (other.range - self.range);
        self.power = power;
    }
}

/// The echoes of a beam: at most one of each of its rays, one of fog, of snow and of rain each.
pub(super) struct EchoList {
    list: [Echo; RAYS + 3],
    len: usize,
}

impl Default for EchoList {
    fn default() -> Self {
        Self { list: [Echo::NONE; RAYS + 3], len: 0 }
    }
}

impl EchoList {
    pub fn push(&mut self, echo: Echo) {
        if let Some(place) = self.list.get_mut(self.len) {
            *place = echo;
            self.len += 1;
        }
    }

    pub fn len(&self) -> usize {
        self.len
    }

    pub fn last_mut(&mut self) -> Option<&mut Echo> {
        self.as_mut_slice().last_mut()
    }

    pub fn as_slice(&self) -> &[Echo] {
        &self.list[..self.len]
    }

    pub fn as_mut_slice(&mut self) -> &mut [Echo] {
        &mut self.list[..self.len]
    }
}
