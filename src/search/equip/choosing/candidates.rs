//! Sensors that may join those chosen: groups that the price, the counts of mounts and the distances allow.

use super::*;

impl Equip {
    /// Groups that may join `chosen`: with room on the mounts, far enough from the others, and money left for the
    /// sensors that other mounts must hold.
    pub(super) fn candidates(&self, chosen: &[Choice]) -> Vec<SensorGroup> {
        let most = self.limits.sensors.min(MAX_LIDARS);
        if chosen.len() >= most {
            return Vec::new();
        }
        let (poses, places) = (Self::poses(chosen), &self.places);
        let spent = self.cost(chosen.iter().copied());
        let cheapest = self.vehicle.cheapest();
        let mut found = Vec::new();
        for pose in 0..self.grid.atlas().grid().len() {
            let one = self.choice(pose);
            let image = match self.image(pose) {
                // Each pair once, by its lower number.
                Some(image) if image < pose => continue,
                Some(image) if image > pose => Some(self.choice(image)),
                _ => None,
            };
            let group = SensorGroup { one, image };
            let (reserve, sensors) = self.owed(chosen, &group, &cheapest);
            let price = self.cost(group.choices());
            let affordable = is_within_budget(spent + price + reserve, self.limits.budget);
            let after = chosen.len() + group.choices().count() + sensors;
            if affordable
                && after <= most
                && self.has_room(chosen, &group)
                && places.fits(pose, &poses)
                && image
                    .is_none_or(|image| places.fits(image.pose, &[&poses[..], &[pose]].concat()))
            {
                found.push(group);
            }
        }
        found
    }

    /// Price and number of the sensors that mounts still lack beside `chosen` and `group`, in the cheapest models.
    fn owed(&self, chosen: &[Choice], group: &SensorGroup, cheapest: &Equipment) -> (f64, usize) {
        let mounts = self.vehicle.mounts.iter().enumerate();
        let owed = mounts.map(|(mount, of)| {
            let missing = of.count[0].saturating_sub(group.count_on(mount, chosen));
            let price = cheapest.iter().find(|(k, _)| *k == mount);
            let price = price.map_or(0.0, |(_, sensor)| self.vehicle.price(*sensor));
            (missing as f64 * price, missing)
        });
        owed.fold((0.0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
    }

    /// True if the mounts of a group hold it beside `chosen`. Where pairs are wanted one sensor of a kind may be
    /// odd, and the others that a mount must hold come in pairs.
    fn has_room(&self, chosen: &[Choice], group: &SensorGroup) -> bool {
        let holds = |choice: Choice| {
            let count = self.vehicle.mounts[choice.mount].count;
            let on = group.count_on(choice.mount, chosen);
            let is_odd = |choice: &Choice| self.image(choice.pose) == Some(choice.pose);
            let alike = |other: &&Choice| {
                (other.mount, other.sensor) == (choice.mount, choice.sensor) && is_odd(other)
            };
            let odd = chosen.iter().chain([&group.one]).filter(alike).count();
            // On a mount whose image is another one pairs take one place, else two.
            let whole = group.image.is_none_or(|image| image.mount == group.one.mount);
            let missing = count[0].saturating_sub(on);
            let fills = !(self.in_pairs && whole)
                || odd == 0
                || missing.is_multiple_of(2)
                || on + missing < count[1];
            on <= count[1] && odd <= 1 && fills
        };
        group.choices().all(holds)
    }

    /// The group with the largest `rating` of (added worth, price), and the worth it adds.
    pub(super) fn best_beside(
        &mut self,
        chosen: &[Choice],
        rating: impl Fn(f64, f64) -> f64,
    ) -> Option<(SensorGroup, f64)> {
        let candidates = self.candidates(chosen);
        let (poses, before) = (Self::poses(chosen), self.worth(chosen));
        let groups: Vec<(u32, Option<u32>)> =
            candidates.iter().map(|of| (of.one.pose, of.image.map(|image| image.pose))).collect();
        let values = self.grid.values_with_groups(&poses, &groups);
        let of = |(group, value): (SensorGroup, f64)| {
            let added = value - before;
            let price = self.cost(group.choices());
            (group, rating(added, price), added)
        };
        let rated = candidates.into_iter().zip(values).map(of);
        // The first of equal ones.
        let best = rated.reduce(|best, other| if other.1 > best.1 { other } else { best });
        best.map(|(group, _, added)| (group, added))
    }
}
