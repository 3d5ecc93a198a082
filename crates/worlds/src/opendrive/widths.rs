//! Widths and offsets of lanes along their stretches: cubics that lead nowhere a lane may be are refused.

use roxmltree::Node;

use super::document::number_or_0 as number;

/// Metres below 0 that rounding leaves of a lane's width.
const NARROWEST: f64 = -0.01;
/// Shortest stretch whose width is followed beyond its start, in metres.
const SHORTEST: f64 = 0.1;
/// Most metres between a road's middle lane and its reference line.
const MOST_ASIDE: f64 = 200.0;

/// Values of an element's cubic that may be its lowest and its highest over so many metres, each with its place: at the ends, and
/// where the derivative b + 2cx + 3dx² is 0.
fn extremes(node: Node<'_, '_>, length: f64) -> impl Iterator<Item = (f64, f64)> {
    let [a, b, c, d] = ["a", "b", "c", "d"].map(|name| number(node, name));
    let root = (c * c - 3.0 * b * d).max(0.0).sqrt();
    let turns = if d == 0.0 {
        [-b / (2.0 * c); 2]
    } else {
        [(-c - root) / (3.0 * d), (-c + root) / (3.0 * d)]
    };
    // Programs end a section by a stretch of a centimetre, whose polynomial is any.
    let length = if length < SHORTEST { 0.0 } else { length };
    let inside = turns.into_iter().filter(move |x| *x > 0.0 && *x < length);
    inside.chain([0.0, length]).map(move |x| (a + x * (b + x * (c + x * d)), x))
}

/// Refuses an offset of lanes that leads far from the reference line before the next record, `length` metres on.
///
/// # Errors
/// The offset, and a remedy.
pub(super) fn aside(node: Node<'_, '_>, length: f64) -> Result<(), String> {
    let (metres, x) =
        extremes(node, length).max_by(|p, q| p.0.abs().total_cmp(&q.0.abs())).unwrap_or_default();
    if metres.abs() <= MOST_ASIDE {
        return Ok(());
    }
    Err(format!(
        "moves the lanes {metres:.1} m aside at {x:.2} m from its start; write coefficients of at most {MOST_ASIDE} m"
    ))
}

/// Refuses a width that falls below 0 before the next record, `length` metres on.
///
/// # Errors
/// The width, and a remedy.
pub(super) fn wide(node: Node<'_, '_>, length: f64) -> Result<(), String> {
    let lowest = extremes(node, length).min_by(|p, q| p.0.total_cmp(&q.0));
    match lowest {
        Some((width, x)) if width < NARROWEST => Err(format!(
            "is a width of {width:.3} m at {x:.2} m from its start; write coefficients of 0 or more metres"
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use roxmltree::Document;

    use super::*;

    /// 4 + 3 x − 0.01 x² is 229 m at its highest, x = 150, and 154 m at x = 300, where it ends.
    #[test]
    fn lanes_that_lead_far_aside_are_refused() {
        let told = |text: &str, length: f64| {
            let xml = Document::parse(text).unwrap();
            aside(xml.root_element(), length).err().unwrap_or_default()
        };
        let bend = "<laneOffset s='0' a='4' b='3' c='-0.01' d='0'/>";
        assert_eq!(
            told(bend, 100.0),
            "moves the lanes 204.0 m aside at 100.00 m from its start; write coefficients of at most 200 m"
        );
        assert_holds!(told(bend, 300.0), "moves the lanes 229.0 m aside at 150.00 m");
        assert_eq!(told(bend, 90.0), "");
        assert_holds!(
            told("<laneOffset s='0' a='-3500' b='0' c='0' d='0'/>", 9.0),
            "lanes -3500.0 m"
        );
    }
}
