//! Numbers of a road that are finite, and yet add up to places that are not: refused before its geometry is computed.

use roxmltree::Node;

/// Largest number of an element, and farthest that a polynomial leads along it: far beyond any map, whose limit tells
/// of roads that are large.
const MOST: f64 = 1e9;
/// Largest second derivative of a polynomial, which steps along a road are computed from.
const MOST_BEND: f64 = 1e15;

const ABCD: [&str; 4] = ["a", "b", "c", "d"];
/// Coefficients of the polynomials of each element.
const POLYNOMIALS: &[(&str, &[[&str; 4]])] = &[
    ("poly3", &[ABCD]),
    ("paramPoly3", &[["aU", "bU", "cU", "dU"], ["aV", "bV", "cV", "dV"]]),
    ("elevation", &[ABCD]),
    ("superelevation", &[ABCD]),
    ("crossfall", &[ABCD]),
    ("shape", &[ABCD]),
    ("laneOffset", &[ABCD]),
    ("width", &[ABCD]),
    ("border", &[ABCD]),
];
/// Metres across a road that the polynomial of a `shape` is followed.
const ACROSS: f64 = 10.0;

/// Checks that the numbers of an element, and its polynomials where they hold, stay within any map.
///
/// # Errors
/// The attribute or the coefficients, and a remedy, in words that follow the element's place.
pub(super) fn check(node: Node<'_, '_>, name: &str, attributes: &[&str]) -> Result<(), String> {
    let polynomials = POLYNOMIALS.iter().find(|(known, _)| *known == name);
    let polynomials = polynomials.map_or(&[][..], |(_, all)| all);
    let mut plain = attributes.iter().filter(|a| !polynomials.iter().flatten().any(|c| c == *a));
    if let Some(far) = plain.find(|a| number(node, a).abs() > MOST) {
        let value = number(node, far);
        return Err(format!(
            "`{far}` is {value:e}, beyond ±1e9; write a number that a map may have"
        ));
    }
    let is_way = name == "road" || name == "geometry";
    if is_way && number(node, "length") < 0.0 {
        let length = number(node, "length");
        return Err(format!("`length` is {length}; write metres, 0 or more"));
    }
    let along = along(node, name);
    for coefficients in polynomials {
        let [a, b, c, d] = coefficients.map(|name| number(node, name).abs());
        let reach = a + along * (b + along * (c + along * d));
        let slope = b + along * (2.0 * c + along * 3.0 * d);
        let bend = 2.0 * c + along * 6.0 * d;
        // Not a number counts as too far.
        if !(reach <= MOST && slope <= MOST && bend <= MOST_BEND) {
            return Err(format!(
                "`{}` lead farther than 1e9 over its {along} m; write the coefficients of a road",
                coefficients.join("`, `")
            ));
        }
    }
    Ok(())
}

/// A number of an element, 0 where there is none.
fn number(node: Node<'_, '_>, name: &str) -> f64 {
    node.attribute(name).and_then(|text| text.trim().parse().ok()).unwrap_or(0.0)
}

/// Largest value of the parameter that the polynomials of an element are evaluated at.
fn along(node: Node<'_, '_>, name: &str) -> f64 {
    let parent = |tag| node.ancestors().find(|n| n.has_tag_name(tag));
    let length = |node: Option<Node<'_, '_>>| node.map_or(0.0, |n| number(n, "length"));
    match name {
        "paramPoly3" => {
            let range = node.attribute("pRange").unwrap_or_default();
            let is_arc = range.eq_ignore_ascii_case("arcLength");
            if is_arc { length(parent("geometry")) } else { 1.0 }
        }
        "poly3" => length(parent("geometry")),
        "shape" => ACROSS,
        _ => {
            let ends = |node: Node<'_, '_>, key| {
                let start = number(node, key);
                let later =
                    node.next_siblings().skip(1).filter(|n| n.tag_name() == node.tag_name());
                let next = later.map(|n| number(n, key)).find(|next| *next > start);
                (start, next)
            };
            let road = length(parent("road"));
            let (start, end) = match node.attribute("sOffset") {
                Some(_) => {
                    let section = parent("laneSection").map(|section| ends(section, "s"));
                    let (from, to) = section.unwrap_or((0.0, None));
                    let (start, next) = ends(node, "sOffset");
                    (start, next.unwrap_or(to.unwrap_or(road) - from))
                }
                None => {
                    let (start, next) = ends(node, "s");
                    (start, next.unwrap_or(road))
                }
            };
            (end - start).max(0.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(element: &str, name: &str) -> Option<String> {
        let text = format!(
            "<road length='5000'><planView><geometry length='100'>{element}</geometry></planView><lanes>\
             <laneSection s='10'><right><lane>{element}</lane></right></laneSection><laneSection s='10.01'/></lanes></road>"
        );
        let xml = roxmltree::Document::parse(&text).unwrap();
        let inside = if name == "paramPoly3" { "geometry" } else { "lane" };
        let node = |n: &Node<'_, '_>| {
            n.has_tag_name(name) && n.parent_element().is_some_and(|p| p.has_tag_name(inside))
        };
        check(xml.descendants().find(node).unwrap(), name, &["sOffset", "a", "b", "c", "d"]).err()
    }

    #[test]
    fn coefficients_are_taken_for_as_far_as_they_hold() {
        // The last centimetre before the next section, as programs write it.
        let width = |d: f64| format!("<width sOffset='0' a='3.5' b='0' c='0' d='{d}'/>");
        assert_eq!(told(&width(-7e6), "width"), None);
        assert!(told(&width(1e17), "width").unwrap().contains("`a`, `b`, `c`, `d` lead farther"));
        let poly = |range: &str, c: f64| format!("<paramPoly3 pRange='{range}' bU='1' cV='{c}'/>");
        for (range, c) in [("arcLength", 1e4), ("normalized", 1e8), ("", 1e8)] {
            assert_eq!(told(&poly(range, c), "paramPoly3"), None, "{range}");
            assert!(told(&poly(range, 100.0 * c), "paramPoly3").is_some(), "{range}");
        }
        for huge in [1e20, -1e308] {
            assert!(told(&poly("arcLength", huge), "paramPoly3").unwrap().contains("`cV`, `dV`"));
        }
    }
}
