//! Casts of sensor poses into pages of an atlas, frame after frame, with questions whether to go on in between.

use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use super::order::{Sparse, ToLevels};
use super::{Atlas, CASTS_AT_ONCE, Page};
use crate::engine::{Backend, BackendError};
use crate::memory;
use crate::vehicle::SensorPose;

/// Asks now and then whether to go on.
pub(super) struct Pace<'a> {
    go_on: &'a mut dyn FnMut(u64) -> bool,
    /// Casts since the last question.
    casts: usize,
}

impl<'a> Pace<'a> {
    pub(crate) fn new(go_on: &'a mut dyn FnMut(u64) -> bool) -> Self {
        Self { go_on, casts: 0 }
    }

    /// Adds `casts` to the count. If that makes too many since the last question, asks `go_on` with the poses cast; false if
    /// it says no.
    fn allows(&mut self, casts: usize, poses_cast: u64) -> bool {
        self.casts += casts;
        if self.casts <= CASTS_AT_ONCE {
            return true;
        }
        self.casts = casts;
        (self.go_on)(poses_cast)
    }
}

impl Atlas {
    /// Casts poses into new pages; `None` once `pace` says no.
    pub(super) fn cast(
        &mut self,
        backend: &mut dyn Backend,
        numbers: &[u32],
        pace: &mut Pace,
    ) -> Result<Option<Vec<Page>>, BackendError> {
        let mut poses: Vec<_> = numbers.iter().map(|&number| self.grid.pose(number)).collect();
        if self.mirrored {
            poses.iter_mut().for_each(|pose| *pose = pose.mirrored());
        }
        let (frames, each, used) = (self.problem.frame_count(), self.order.words(), self.clock);
        memory::check("bitmaps of sensor poses", (numbers.len() * self.page_bytes()) as u64)?;
        // Allocated by the threads that fill them: the first touch of new memory takes as long as the copy.
        let area_words = self.areas.words();
        let page = |_| Page {
            occupied: vec![0; frames * each].into(),
            empty: vec![],
            areas: vec![0; frames * area_words].into(),
            used,
        };
        let mut pages: Vec<Page> = numbers.par_iter().map(page).collect();
        for frame in 0..frames {
            let equal = self.problem.first_equal(frame);
            if equal < frame {
                for page in &mut pages {
                    page.occupied.copy_within(equal * each..(equal + 1) * each, frame * each);
                    page.empty.extend(page.empty.get(equal).cloned());
                    let areas = equal * area_words..(equal + 1) * area_words;
                    page.areas.copy_within(areas, frame * area_words);
                }
                continue;
            }
            if !pace.allows(poses.len(), self.poses_cast()) {
                return Ok(None);
            }
            self.cast_frame(backend, &poses, frame, &mut pages)?;
        }
        Ok(Some(pages))
    }

    /// Writes the coverage of each pose in one frame into its page.
    fn cast_frame(
        &mut self,
        backend: &mut dyn Backend,
        poses: &[SensorPose],
        frame: usize,
        pages: &mut [Page],
    ) -> Result<(), BackendError> {
        let order = backend.order();
        if self.to_levels.as_ref().is_none_or(|to_levels| to_levels.from != order) {
            self.to_levels = Some(ToLevels::new(&self.order, self.problem.content(), order));
        }
        let Some(to_levels) = &self.to_levels else { return Ok(()) };
        let empty_order = *self.empty_order.get_or_insert(order);
        let (areas, each, area_words) = (&self.areas, self.order.words(), self.areas.words());
        let counts_all = self.empty_words > 0;
        let pages: Vec<Mutex<&mut Page>> = pages.iter_mut().map(Mutex::new).collect();
        backend.each_bitmap(poses, frame, &|pose, from, bitmap| {
            let Ok(mut page) = pages[pose].lock() else { return };
            // Another engine takes over from a device that is lost, and hands out all poses again.
            let bitmap = from.convert(bitmap, &order);
            let occupied = &mut page.occupied[frame * each..(frame + 1) * each];
            occupied.fill(0);
            to_levels.reorder(&bitmap, occupied);
            let seen = &mut page.areas[frame * area_words..(frame + 1) * area_words];
            seen.fill(0);
            areas.take(order, &bitmap, seen);
            if counts_all {
                let empty = to_levels.empty(&bitmap);
                let sparse = if order == empty_order {
                    Sparse::new(empty)
                } else {
                    let empty: Vec<u64> = empty.collect();
                    Sparse::new(order.convert(&empty, &empty_order).iter().copied())
                };
                page.empty.truncate(frame);
                page.empty.push(Arc::new(sparse));
            }
        })
    }
}
