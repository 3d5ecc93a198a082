//! A drawing as PDF 1.4 of one page: paths, and words in the standard fonts Helvetica and Helvetica-Bold.

use std::fmt::Write;

use super::{Drawing, HALO, Ink, Point, Shape, Stroke, WHITE, mm};

/// Points of the format a millimetre: 72 an inch.
const POINTS: f64 = 72.0 / 25.4;
/// Control points of a quarter of a circle by cubic curves, as a share of its radius.
const ROUND: f64 = 0.552_284_75;
/// Widths of the characters from space to `~` in Helvetica, thousandths of the font's size (Adobe's metrics).
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556,
    556, 556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667,
    611, 778, 722, 278, 500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667,
    667, 611, 278, 278, 278, 469, 556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500,
    222, 833, 556, 556, 556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];
/// Width of every other character.
const OTHER: u16 = 556;

impl Drawing {
    /// The drawing as a PDF file of one page of the sheet's size. A character outside of Latin-1 is written as `?`.
    pub(crate) fn pdf(&self) -> Vec<u8> {
        let mut page = PdfPage::default();
        let height = self.size[1] * POINTS;
        // From millimetres downwards to points upwards.
        let _ = writeln!(page.content, "{POINTS:.6} 0 0 {:.6} 0 {height:.4} cm 1 j 1 J", -POINTS);
        self.shapes.iter().for_each(|shape| page.add(shape));
        let [width, height] = self.size.map(|side| format!("{:.3}", side * POINTS));
        let states: String =
            (0..page.opacities.len()).map(|k| format!("/A{k} {} 0 R ", 8 + k)).collect();
        let length = page.content.chars().count();
        let mut objects = vec![
            "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
            "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
            format!(
                "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R /Resources << /Font \
                 << /F0 5 0 R /F1 6 0 R >> /ExtGState << {states}>> >> >>"
            ),
            format!("<< /Length {length} >>\nstream\n{}\nendstream", page.content),
        ];
        objects.extend(["Helvetica", "Helvetica-Bold"].map(|font| {
            format!(
                "<< /Type /Font /Subtype /Type1 /BaseFont /{font} /Encoding /WinAnsiEncoding >>"
            )
        }));
        objects.push(format!("<< /Title ({}) /Producer (sightline) >>", escaped(&self.title)));
        let state = |opacity: &f64| format!("<< /Type /ExtGState /ca {0} /CA {0} >>", mm(*opacity));
        objects.extend(page.opacities.iter().map(state));
        file(&objects)
    }
}

/// All objects with their numbers from 1, the table of their places, and the trailer. The seventh is the description.
fn file(objects: &[String]) -> Vec<u8> {
    let mut bytes = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n".to_vec();
    let mut places = Vec::new();
    for (k, object) in objects.iter().enumerate() {
        places.push(bytes.len());
        bytes.extend(format!("{} 0 obj\n", k + 1).bytes());
        bytes.extend(latin(object));
        bytes.extend(b"\nendobj\n");
    }
    let (start, count) = (bytes.len(), objects.len() + 1);
    let places: String = places.iter().map(|place| format!("{place:010} 00000 n \n")).collect();
    let end = format!(
        "xref\n0 {count}\n0000000000 65535 f \n{places}trailer\n<< /Size {count} /Root 1 0 R /Info 7 0 R \
         >>\nstartxref\n{start}\n%%EOF\n"
    );
    bytes.extend(end.bytes());
    bytes
}

/// Content of the page in millimetres from its upper left corner, and the opacities that it names.
#[derive(Default)]
struct PdfPage {
    content: String,
    opacities: Vec<f64>,
}

impl PdfPage {
    fn opacity(&mut self, ink: Ink) -> String {
        let known = self.opacities.iter().position(|known| *known == ink.1);
        let number = known.unwrap_or_else(|| {
            self.opacities.push(ink.1);
            self.opacities.len() - 1
        });
        format!("/A{number} gs")
    }

    fn fill(&mut self, ink: Ink) {
        let (opacity, [r, g, b]) = (self.opacity(ink), ink.rgb().map(mm));
        let _ = writeln!(self.content, "{opacity} {r} {g} {b} rg");
    }

    fn stroke(&mut self, stroke: Stroke) {
        let (opacity, [r, g, b]) = (self.opacity(stroke.ink), stroke.ink.rgb().map(mm));
        let dash = if stroke.dash > 0.0 { mm(stroke.dash) } else { String::new() };
        let width = mm(stroke.width);
        let _ = writeln!(self.content, "{opacity} {r} {g} {b} RG {width} w [{dash}] 0 d");
    }

    fn path(&mut self, points: &[Point]) {
        for (k, [x, y]) in points.iter().enumerate() {
            let operator = if k == 0 { "m" } else { "l" };
            let _ = writeln!(self.content, "{} {} {operator}", mm(*x), mm(*y));
        }
    }

    fn loops(&mut self, loops: &[Vec<Point>], paint: &str) {
        for corners in loops.iter().filter(|corners| !corners.is_empty()) {
            self.path(corners);
            self.content.push_str("h\n");
        }
        self.content.push_str(paint);
    }

    fn add(&mut self, shape: &Shape) {
        match shape {
            // Filled and drawn one after the other, since opacities may differ.
            Shape::Area { loops, fill, stroke } => {
                if let Some(ink) = fill {
                    self.fill(*ink);
                    self.loops(loops, "f*\n");
                }
                if let Some(stroke) = stroke {
                    self.stroke(*stroke);
                    self.loops(loops, "S\n");
                }
            }
            Shape::Line { points, stroke } => {
                self.stroke(*stroke);
                self.path(points);
                self.content.push_str("S\n");
            }
            Shape::Disc { at, radius, fill } => {
                self.fill(*fill);
                self.disc(*at, *radius);
            }
            Shape::Words { at, words, size, anchor, bold, ink } => {
                self.fill(*ink);
                let (x, y) = (at[0] - anchor.share() * width(words, *size), at[1]);
                // Drawn as white lines first, then filled: `Tr` of 1 and of 0.
                if ink.0 != WHITE {
                    self.stroke(Stroke::solid(WHITE, HALO * size));
                    self.shown(([x, y], *size, *bold), words, 1);
                }
                self.shown(([x, y], *size, *bold), words, 0);
            }
        }
    }

    /// Words at the left end of their base line, of a size, bold or not, painted in a mode of the format.
    fn shown(&mut self, ([x, y], size, bold): (Point, f64, bool), words: &str, mode: u8) {
        let (font, size, words) = (u8::from(bold), mm(size), escaped(words));
        let _ = writeln!(
            self.content,
            "BT /F{font} {size} Tf {mode} Tr 1 0 0 -1 {} {} Tm ({words}) Tj ET",
            mm(x),
            mm(y)
        );
    }

    fn disc(&mut self, [x, y]: Point, radius: f64) {
        let (k, r) = (ROUND * radius, radius);
        let _ = writeln!(self.content, "{} {} m", mm(x + r), mm(y));
        for [a, b, c, d, e, f] in [
            [r, k, k, r, 0.0, r],
            [-k, r, -r, k, -r, 0.0],
            [-r, -k, -k, -r, 0.0, -r],
            [k, -r, r, -k, r, 0.0],
        ] {
            let [a, c, e] = [a, c, e].map(|by| mm(x + by));
            let [b, d, f] = [b, d, f].map(|by| mm(y + by));
            let _ = writeln!(self.content, "{a} {b} {c} {d} {e} {f} c");
        }
        self.content.push_str("f\n");
    }
}

/// Millimetres that words take in Helvetica of a size in millimetres.
fn width(words: &str, size: f64) -> f64 {
    let of = |c: char| {
        let place = (c as usize).checked_sub(32);
        place.and_then(|place| WIDTHS.get(place)).copied().unwrap_or(OTHER)
    };
    words.chars().map(|c| f64::from(of(c))).sum::<f64>() * size / 1000.0
}

/// Words inside of brackets: those of their own and the sign before them are marked.
fn escaped(words: &str) -> String {
    let plain = words.chars().map(|c| if c.is_control() { ' ' } else { c });
    plain.flat_map(|c| "()\\".contains(c).then_some('\\').into_iter().chain([c])).collect()
}

/// Bytes of the encoding WinAnsi, which has the characters of Latin-1 and a few more.
fn latin(text: &str) -> Vec<u8> {
    let byte = |c: char| match c {
        '–' => 0x96,
        '—' => 0x97,
        '…' => 0x85,
        '−' => b'-',
        '\n' | ' '..='~' | '\u{a0}'..='\u{ff}' => c as u8,
        _ => b'?',
    };
    text.chars().map(byte).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_are_those_of_helvetica() {
        // Adobe's metrics: A 667, i 222, space 278.
        assert!((width("A i", 10.0) - 11.67).abs() < 1e-9);
        assert_eq!(latin("1 × 2° – \u{4e2d}"), b"1 \xd7 2\xb0 \x96 ?");
        assert_eq!(escaped("a(b)\\\u{7}"), "a\\(b\\)\\\\ ");
    }

    #[test]
    fn the_table_at_the_end_names_the_place_of_every_object() {
        let mut drawing = Drawing::new([100.0, 50.0], "a (b)");
        drawing.words([1.0, 2.0], 3.0, "it's (so)");
        drawing.disc([1.0, 2.0], 3.0, Ink("#ff0000", 0.25));
        let bytes = drawing.pdf();
        // A character a byte, so that places are those of the file.
        let ascii = |&byte: &u8| if byte.is_ascii() { char::from(byte) } else { '?' };
        let text: String = bytes.iter().map(ascii).collect();
        assert!(text.contains("<< /Type /Page /Parent 2 0 R "), "readers look for this type");
        let start = text.rsplit("startxref\n").next().unwrap().lines().next().unwrap();
        let table = &text[start.parse().unwrap()..];
        let places = table.lines().skip(3).take_while(|line| line.ends_with(" n "));
        let mut count = 0;
        for (k, line) in places.enumerate() {
            let place: usize = line[..10].parse().unwrap();
            assert!(text[place..].starts_with(&format!("{} 0 obj\n", k + 1)), "{line}");
            count = k + 1;
        }
        // Two opacities: 1 of the words and 0.25 of the disc.
        assert_eq!(count, 9);
        assert!(
            text.contains("/MediaBox [0 0 283.465 141.732]") && text.contains("(it's \\(so\\)) Tj")
        );
        // White lines around the letters first, then the letters.
        assert!(text.find("1 Tr").unwrap() < text.find("0 Tr").unwrap(), "{text}");
    }
}
