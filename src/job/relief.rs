//! Scenes whose ground is not level, in words.

use super::{Job, JobError};
use crate::targets::{GroundBelow, Relief};

impl Job {
    /// Sentence on the first scene whose ground leaves z = 0 by more than 0.2 m where targets of requirements and of the range
    /// card stand: the first stand on level ground, the range card on that of the scene. `None` where there is none, and with
    /// coverage `through`.
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
            return Ok(Some(match rules.iter().any(|rule| !rule.on_scene) {
                true => format!(
                    "targets of requirements stand on level ground, and the ground of {name} {relief}; `study targets` with \
                     this scene looks at targets on it, and so do range cards, and requirements with `\"ground\": \"scene\"`"
                ),
                false => format!("the range card stands on the ground of {name}, which {relief}"),
            }));
        }
        Ok(None)
    }
}
