//! The best of all rigs on a grid that has few of them: fixed brackets, say, of which only the sensors are open.

use super::*;

/// Most poses of a grid whose rigs are counted.
const FEW_POSES: u32 = 64;
/// Most rigs that are looked at one by one.
const FEW_RIGS: usize = 1000;

/// Sensors to which others are added whose poses have higher numbers than `last`.
struct Begun {
    chosen: Vec<Choice>,
    last: Option<u32>,
}

impl Equip {
    /// Poses of the best rig within the limits, the first of equal ones; `None` where rigs are many, where there is none, and
    /// where the watch is over. Climbs exchange one sensor at a time: they may end at a rig that only two exchanges at once
    /// better.
    pub(super) fn best_of_few(&mut self, watch: &Watch) -> Option<Vec<u32>> {
        let mut best: Option<(f64, Vec<u32>)> = None;
        self.each_of_few(watch, |equip, chosen, groups| {
            let added: Vec<(u32, Option<u32>)> =
                groups.iter().map(|of| (of.one.pose, of.image.map(|image| image.pose))).collect();
            let values = equip.grid.values_with_groups(&Self::poses(chosen), &added);
            for (group, value) in groups.iter().zip(values) {
                let rig = beside(chosen, group);
                if equip.is_rig(&rig) && best.as_ref().is_none_or(|(most, _)| value > *most) {
                    best = Some((value, Self::poses(&rig)));
                }
            }
        })?;
        best.map(|(_, poses)| poses)
    }

    /// Every rig within the limits; `None` where rigs are many, and where the watch is over.
    pub(in crate::search::equip) fn every_of_few(&mut self, watch: &Watch) -> Option<EveryRig> {
        let mut all: Vec<Vec<Choice>> = Vec::new();
        self.each_of_few(watch, |equip, chosen, groups| {
            let rigs = groups.iter().map(|group| beside(chosen, group));
            all.extend(rigs.filter(|rig| equip.is_rig(rig)));
        })?;
        let rigs = all.iter().map(|rig| self.equipped(rig)).collect();
        // One pose for each model on each mount, and no angle of a spinning head that is searched.
        let has_phase = self.vehicle.every_kind().slots.iter().any(|slot| slot.phase.is_some());
        let is_fixed = self.pose_count() as usize == self.kinds.len() && !has_phase;
        Some(EveryRig { rigs, is_fixed })
    }

    /// Visits every rig within the limits: sensors chosen, and those that may join them one at a time. `None` where
    /// rigs are many, and where the watch is over.
    fn each_of_few(
        &mut self,
        watch: &Watch,
        mut visit: impl FnMut(&mut Self, &[Choice], &[SensorGroup]),
    ) -> Option<()> {
        if self.pose_count() > FEW_POSES {
            return None;
        }
        let mut open = vec![Begun { chosen: Vec::new(), last: None }];
        let mut count = 0;
        while let Some(Begun { chosen, last }) = open.pop() {
            let mut groups = self.candidates(&chosen);
            groups.retain(|group| last.is_none_or(|last| group.one.pose > last));
            count += groups.len();
            if count > FEW_RIGS || watch.is_over() {
                return None;
            }
            visit(self, &chosen, &groups);
            open.extend(groups.iter().map(|group| {
                let last = Some(group.one.pose);
                Begun { chosen: beside(&chosen, group), last }
            }));
        }
        Some(())
    }
}

/// Sensors with a group beside them.
fn beside(chosen: &[Choice], group: &SensorGroup) -> Vec<Choice> {
    chosen.iter().copied().chain(group.choices()).collect()
}
