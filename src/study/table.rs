use serde::{Deserialize, Serialize};

use crate::vehicle::Placement;

/// One line of a study: a case and what was measured of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The case.
    pub name: String,
    /// A number for each column; `None` where there is none.
    pub values: Vec<Option<f64>>,
    /// The placement that the case ended with, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub placement: Option<Placement>,
}

/// The result of a study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// What was studied.
    pub title: String,
    /// Title of the cases, then of each value.
    pub columns: Vec<String>,
    /// The cases in order.
    pub rows: Vec<Row>,
    /// What the numbers say, and what they do not, in sentences.
    pub notes: Vec<String>,
}

impl Table {
    /// Comma-separated, the columns' titles first; missing numbers are empty.
    pub fn csv(&self) -> String {
        let mut text = self.columns.iter().map(|c| quoted(c)).collect::<Vec<_>>().join(",") + "\n";
        for row in &self.rows {
            let values = row.values.iter().map(|v| v.map_or(String::new(), |v| v.to_string()));
            let cells: Vec<String> = std::iter::once(quoted(&row.name)).chain(values).collect();
            text += &(cells.join(",") + "\n");
        }
        text
    }

    /// Numbers of one column, row after row.
    pub fn column(&self, title: &str) -> Vec<Option<f64>> {
        let at = self.columns.iter().position(|c| c == title);
        let at = at.and_then(|at| at.checked_sub(1));
        self.rows
            .iter()
            .map(|row| at.and_then(|at| row.values.get(at).copied().flatten()))
            .collect()
    }
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// Where a curve of falling gains bends most: the point farthest above the line from the first to the
/// last, after both axes are scaled to [0, 1]. `None` with fewer than three points or without rise.
pub fn knee(values: &[f64]) -> Option<usize> {
    let (first, last) = (*values.first()?, *values.last()?);
    if values.len() < 3 || last <= first {
        return None;
    }
    let steps = (values.len() - 1) as f64;
    let above = |k: usize| (values[k] - first) / (last - first) - k as f64 / steps;
    (1..values.len() - 1).max_by(|&a, &b| above(a).total_cmp(&above(b))).filter(|&k| above(k) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_as_csv() {
        let row = |name: &str, values: &[Option<f64>]| Row {
            name: name.into(),
            values: values.to_vec(),
            placement: None,
        };
        let table = Table {
            title: "t".into(),
            columns: vec!["case".into(), "a, b".into(), "c".into()],
            rows: vec![row("x", &[Some(1.5), None]), row("\"y\"", &[Some(-2.0), Some(0.0)])],
            notes: vec![],
        };
        assert_eq!(table.csv(), "case,\"a, b\",c\nx,1.5,\n\"\"\"y\"\"\",-2,0\n");
        assert_eq!(table.column("c"), [None, Some(0.0)]);
        assert_eq!(table.column("case"), [None, None]);
    }

    #[test]
    fn the_knee_is_where_the_curve_bends() {
        assert_eq!(knee(&[0.0, 8.0, 9.0, 9.5, 10.0]), Some(1));
        assert_eq!(knee(&[0.0, 1.0, 2.0]), None, "a line has no knee");
        assert_eq!(knee(&[3.0, 2.0, 1.0]), None);
    }
}
