//! Subject of a page.

use crate::report::{RunRecord, SceneRecord, judged, verdict};
use crate::search::Scored;

/// Subject of a page, whether it was searched for or given.
#[derive(Debug, Clone)]
pub struct Subject<'a> {
    /// Name of the scene; all names where there are several.
    pub scene: &'a str,
    /// Each of several scenes.
    pub scenes: &'a [SceneRecord],
    /// Score of the comparison.
    pub objective: &'a str,
    /// Weather and faults that it holds for, as they are written.
    pub conditions: &'a [String],
    /// The result in sentences, the first of which heads the page.
    pub verdict: String,
    /// The placement of the page; `None` where a search found nothing.
    pub result: Option<&'a Scored>,
    /// Layouts to compare with.
    pub baselines: &'a [Scored],
    /// The command that makes this page again.
    pub command: String,
}

impl<'a> Subject<'a> {
    /// The subject of a run.
    pub fn of(run: &'a RunRecord) -> Self {
        Self {
            scene: &run.scene,
            scenes: &run.scenes,
            objective: &run.objective,
            conditions: &run.conditions,
            verdict: verdict(run.best.as_ref(), &run.baselines, &run.objective),
            result: run.best.as_ref(),
            baselines: &run.baselines,
            command: format!("{} --backend {}", run.command, run.backend),
        }
    }

    /// A placement that was given, by `objective` in clear air; `command` makes the page again.
    pub fn given(
        scene: &'a str,
        scenes: &'a [SceneRecord],
        result: &'a Scored,
        baselines: &'a [Scored],
        objective: &'a str,
        command: String,
    ) -> Self {
        let verdict = judged(&result.placement.name, result, baselines, objective);
        let (conditions, result) = (&[][..], Some(result));
        Self { scene, scenes, objective, conditions, verdict, result, baselines, command }
    }

    /// The subject with weather and faults that it holds for.
    #[must_use]
    pub fn under(self, conditions: &'a [String]) -> Self {
        Self { conditions, ..self }
    }

    /// The best baseline that keeps all rules.
    pub(super) fn rival(&self) -> Option<&'a Scored> {
        Scored::yardstick(self.baselines)
    }
}
