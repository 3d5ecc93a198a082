//! Frames that a search chose on demand, in words.

use super::{FramesOnDemand, SearchEnd};
use crate::json::counted;

impl FramesOnDemand {
    pub(super) fn words(&self, share: f64, end: SearchEnd) -> String {
        let all = self.levels[self.levels.len() - 1].len();
        if all == 1 {
            return "searched over the only frame that there is".to_owned();
        }
        if !self.has_choice() {
            return format!("searched over all {all} frames: fewer would not keep the ranking");
        }
        let steps = in_steps(&self.steps, all);
        let took = format!(
            "this took {:.0} % of the placements × frames of a search over all",
            100.0 * share
        );
        let judged = match self.confirmed_count() {
            0 => {
                let of = if end.frames < all { format!("{} of", end.frames) } else { "all".into() };
                let SearchEnd { early, .. } = end;
                format!(
                    "its result is scored over {of} {all} frames, and no finalist was confirmed over all{early}; {took}"
                )
            }
            count => {
                format!("with {} confirmed over all frames {took}", counted(count, "finalist"))
            }
        };
        let words = format!("searched over {}; {judged}", steps.join(", "));
        let loss = self.worst_loss.map(|worst| format!("; {}", loss_in_words(worst)));
        words + &loss.unwrap_or_default()
    }
}

/// Most that a choice by few frames lost among the finalists, as a share of the best value over all frames.
fn loss_in_words(worst: f64) -> String {
    match 100.0 * worst {
        loss if loss <= 0.0 => {
            "scores over few frames ranked the best finalist first, as all frames do".to_owned()
        }
        loss if loss < 0.001 => {
            "ranking the finalists over few frames instead of all lost less than 0.001 % of the best value".to_owned()
        }
        loss => {
            // Two significant digits.
            let decimals = [10.0, 1.0, 0.1, 0.01].iter().filter(|least| loss < **least).count();
            format!(
                "ranking the finalists over few frames instead of all lost {loss:.decimals$} % of the best value, at most"
            )
        }
    }
}

/// Numbers of frames in words, levels after one generation together: `1 of 40 frames`, `4 and 8 after generation 15`.
fn in_steps(steps: &[(u64, u32)], all: usize) -> Vec<String> {
    let of_one = |same: &[(u64, u32)]| {
        let frames: Vec<String> = same.iter().map(|(_, frames)| frames.to_string()).collect();
        let frames = match frames.split_last() {
            Some((last, first)) if !first.is_empty() => format!("{} and {last}", first.join(", ")),
            _ => frames.concat(),
        };
        match same[0].0 {
            0 => format!("{frames} of {all} frames"),
            generation => format!("{frames} after generation {generation}"),
        }
    };
    steps.chunk_by(|a, b| a.0 == b.0).map(of_one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Standing;
    use crate::search::on_demand::Finalist;
    use crate::vehicle::Placement;

    #[test]
    fn a_loss_is_told_only_where_there_was_one() {
        assert!(loss_in_words(0.0).ends_with("as all frames do"));
        assert!(loss_in_words(1e-9).ends_with("lost less than 0.001 % of the best value"));
        for (loss, told) in [(0.0012, "0.12 %"), (0.10863, "11 %"), (0.0158, "1.6 %")] {
            let words = loss_in_words(loss);
            assert!(words.contains(&format!(" lost {told} of the best value, at most")), "{words}");
        }
    }

    #[test]
    fn finalists_that_were_never_compared_say_nothing_of_a_loss() {
        let standing = Standing { value: Some(0.4), ..Standing::outside(0.0) };
        let finalist = |confirmed: Option<f64>| Finalist {
            placement: Placement { name: String::new(), lidars: Vec::new() },
            standing,
            confirmed: confirmed.map(|value| Standing { value: Some(value), ..standing }),
        };
        let seen = |values: &[Option<f64>]| {
            let mut levels = FramesOnDemand::hurried(vec![0], 4);
            levels.finalists = values.iter().map(|value| finalist(*value)).collect();
            levels.note_last_loss();
            let used = levels.used(1, 0, 1, SearchEnd { frames: 4, early: "" });
            (used.worst_loss_seen, used.words)
        };
        let never: [&[Option<f64>]; 3] = [&[], &[None, None], &[Some(0.4)]];
        for (loss, words) in never.map(seen) {
            assert!(loss.is_none() && words.ends_with("of a search over all"), "{words}");
        }
        // A check within the generations looks at the first finalists; the best stands behind them.
        let (loss, words) = seen(&[Some(0.4), Some(0.3), Some(0.3), Some(0.3), Some(0.5)]);
        assert!(
            (loss.unwrap() - 0.2).abs() < 1e-12 && words.ends_with("of the best value, at most"),
            "{words}"
        );
        let (loss, words) = seen(&[Some(0.4), Some(0.3)]);
        assert!(loss == Some(0.0) && words.ends_with("as all frames do"), "{words}");
    }

    #[test]
    fn a_search_without_confirmed_finalists_says_over_how_many_frames_its_result_is_scored() {
        let levels = FramesOnDemand::hurried(vec![0], 40);
        let words = |frames, early| levels.used(1, 0, 1, SearchEnd { frames, early }).words;
        for (frames, early, told) in [
            (
                40,
                " for want of time",
                "over all 40 frames, and no finalist was confirmed over all for want of time; this",
            ),
            (
                4,
                ": interrupted",
                "over 4 of 40 frames, and no finalist was confirmed over all: interrupted; this took",
            ),
        ] {
            let words = words(frames, early);
            let start = "searched over 1 of 40 frames; its result is scored ";
            assert!(words.starts_with(&format!("{start}{told}")), "{words}");
        }
    }
}
