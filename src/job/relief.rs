//! Scenes whose ground is not level, in words.

use super::{Job, JobError};
use crate::targets::{GroundBelow, Relief};

impl Job {
    /// Sentence on the first scene whose ground leaves z = 0 by more than 0.2 m where targets of requirements and of the range
    /// card stand. `None` where there is none, and with coverage `through`.
    ///
    /// # Errors
    /// See [`Self::problem`].
    pub(crate) fn relief_in_words(&self) -> Result<Option<String>, JobError> {
        if self.target_site()?.is_none() {
            return Ok(None);
        }
        for scene in &self.scenes {
            let problem = scene.problem()?;
            let Some(relief) = Relief::of(&problem, &GroundBelow::new(scene.scene())) else {
                continue;
            };
            let (name, rules) = (scene.scene().name(), problem.target_rules());
            let has_rules = rules.iter().any(|rule| !rule.on_scene);
            if relief.is_steep() && !has_rules {
                return Ok(Some(format!(
                    "the range card stands on the ground of {name}, which {relief}"
                )));
            }
            let [who, on_it] = match (has_rules, relief.is_steep()) {
                (true, true) => ["requirements", "range cards, and requirements"],
                (true, false) => ["requirements and range card", "requirements"],
                (false, _) => ["the range card", "requirements"],
            };
            return Ok(Some(format!(
                "targets of {who} stand on level ground, and the ground of {name} {relief}; `study targets` with this scene \
                 looks at targets on it, and so do {on_it} with `\"ground\": \"scene\"`"
            )));
        }
        Ok(None)
    }
}
