//! Things by the number of LiDARs that see them, and the overlap of pairs, as text.

use super::text::{align_columns, shortened};
use crate::json::fixed;
use crate::shared::{Overlap, Redundancy, SeenBy, SeenByTechnologies, Technologies};
use crate::vehicle::SensorName;

/// Longest line of the table of technologies, in characters.
const WIDEST: usize = 100;
/// Longest name of a thing in the table of technologies, in characters.
const LONGEST_NAME: usize = 24;

/// LiDAR by its number, with its model where it has a name: `0 roof-64`.
fn lidar(number: usize, sensor: SensorName) -> String {
    if sensor.is_none() { number.to_string() } else { format!("{number} {sensor}") }
}

fn percent(share: Option<f64>) -> String {
    super::optional(share.map(|share| 100.0 * share), 1)
}

/// A line of a table: a name, how many things there are, shares in percent.
fn line(name: String, seen: &SeenBy) -> Vec<String> {
    let mut row = vec![name, fixed(seen.all, 0)];
    row.extend((0..seen.by.len()).map(|k| percent(seen.share.map(|share| share[k]))));
    row.extend(seen.alone.iter().map(|alone| percent(alone.share)));
    row
}

/// Title of a row: the scene and the placement.
fn heading(scene: &str, placement: &str, lidars: usize, frames: usize) -> String {
    format!("{placement} in {scene}: {lidars} LiDARs, {frames} frame(s)")
}

/// A table a placement and scene: things that count, and the shares of them that no, one, two, three and more LiDARs
/// see.
pub fn redundancy_text(all: &[&Redundancy]) -> String {
    let of = |row: &&Redundancy| {
        let titles = ["% seen by", "of", "0", "1", "2", "3+"].map(str::to_owned);
        let alone = row.voxels.alone.iter().map(|alone| format!("{} alone", alone.sensor));
        let mut rows = vec![titles.into_iter().chain(alone).collect::<Vec<_>>()];
        rows.push(line("voxels, occupied".to_owned(), &row.occupied));
        rows.push(line("voxels, all".to_owned(), &row.voxels));
        let ground = [("ground to 3 m", &row.ground_3m), ("ground to 10 m", &row.ground_10m)];
        for (name, seen) in ground {
            rows.extend(seen.as_ref().map(|seen| line(name.to_owned(), seen)));
        }
        rows.extend(row.targets.iter().map(|of| line(of.target.clone(), &of.seen)));
        let heading = heading(&row.scene, &row.placement, row.lidars.len(), row.frames);
        let technologies = row.technologies.as_ref().map(technologies_text).unwrap_or_default();
        format!("{heading}\n{}{technologies}", align_columns(&rows))
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}

/// Tables of at most [`WIDEST`] characters: shares of things by the number of technologies, and that each technology sees.
fn technologies_text(all: &Technologies) -> String {
    let ground = [("ground to 3 m", &all.ground_3m), ("ground to 10 m", &all.ground_10m)];
    let ground = ground.into_iter().filter_map(|(name, seen)| Some((name, seen.as_ref()?)));
    let targets = all.targets.iter().map(|of| (of.target.as_str(), &of.seen));
    let things = std::iter::once(("voxels, occupied", &all.occupied)).chain(ground).chain(targets);
    let things: Vec<(&str, &SeenByTechnologies)> = things.collect();
    let name = |name: &str| vec![shortened(name, LONGEST_NAME)];
    let numbers = ["% by technologies", "of", "blind to all", "by 1", "2", "3+"].map(str::to_owned);
    let mut table = vec![numbers.to_vec()];
    table.extend(things.iter().map(|(thing, seen)| {
        let number = &seen.number;
        let shares = (0..number.by.len()).map(|k| percent(number.share.map(|share| share[k])));
        name(thing).into_iter().chain([fixed(number.all, 0)]).chain(shares).collect()
    }));
    let mut tables = vec![table];
    for (k, of) in all.sensors.iter().enumerate() {
        let mut column = vec![format!("{} {}", of.count, of.technology)];
        column.extend(things.iter().map(|(_, seen)| percent(seen.each[k].share)));
        let wider = |table: &[Vec<String>]| {
            let rows = table.iter().zip(&column);
            rows.map(|(row, cell)| [&row[..], std::slice::from_ref(cell)].concat()).collect()
        };
        let wide: Vec<Vec<String>> = tables.last().map(|table| wider(table)).unwrap_or_default();
        match align_columns(&wide).lines().all(|line| line.chars().count() <= WIDEST) {
            true => {
                tables.pop();
                tables.push(wide);
            }
            false => {
                let mut first = vec![name("% seen by")];
                first.extend(things.iter().map(|(thing, _)| name(thing)));
                tables.push(wider(&first));
            }
        }
    }
    tables.iter().map(|table| format!("\n{}", align_columns(table))).collect()
}

/// A matrix whose rows and columns are LiDARs.
fn matrix(title: &str, row: &Overlap, cell: impl Fn(usize, usize) -> String) -> String {
    let count = row.lidars.len();
    let titles = std::iter::once(title.to_owned()).chain((0..count).map(|k| k.to_string()));
    let mut rows = vec![titles.collect::<Vec<_>>()];
    for (a, sensor) in row.lidars.iter().enumerate() {
        let cells = (0..count).map(|b| cell(a, b));
        rows.push(std::iter::once(lidar(a, *sensor)).chain(cells).collect());
    }
    align_columns(&rows)
}

/// A sentence on the pairs that connect the LiDARs, or on the LiDARs that none connects.
fn verdict(row: &Overlap) -> String {
    let names = |lidars: &[usize]| {
        let named = lidars.iter().map(|&k| lidar(k, row.lidars[k]));
        named.collect::<Vec<_>>().join(", ")
    };
    let least = row.least_shared;
    if !row.connected {
        let cut_off = row.cut_off.iter().map(|&cut| {
            let others = (0..row.lidars.len()).filter(|&other| other != cut);
            let best = others.max_by(|&a, &b| {
                let shared = &row.shared_voxels[cut];
                shared[a].total_cmp(&shared[b]).then(b.cmp(&a))
            });
            let best = best.filter(|&best| row.shared_voxels[cut][best] > 0.0);
            let most = best.map_or("nothing with any other".to_owned(), |best| {
                format!("{} with {best}", fixed(row.shared_voxels[cut][best], 0))
            });
            format!("{} (shares {most})", lidar(cut, row.lidars[cut]))
        });
        return format!(
            "NOT CONNECTED at {least} shared voxels; cut off from {}: {}",
            names(&row.groups[0]),
            cut_off.collect::<Vec<_>>().join(", ")
        );
    }
    let chain = row.chain.iter().map(|pair| format!("{}–{}", pair.lidars[0], pair.lidars[1]));
    format!(
        "Connected at {least} shared voxels, and up to {}, by the pairs {}",
        fixed(row.connected_up_to.floor(), 0),
        chain.collect::<Vec<_>>().join(", ")
    )
}

/// Three matrices a placement and scene, and whether pairs connect all LiDARs.
pub fn overlap_text(all: &[Overlap]) -> String {
    let of = |row: &Overlap| {
        let heading = heading(&row.scene, &row.placement, row.lidars.len(), row.frames);
        let voxels = matrix("surface voxels", row, |a, b| fixed(row.shared_voxels[a][b], 0));
        let overlap = matrix("overlap %", row, |a, b| fixed(100.0 * row.overlap[a][b], 1));
        let directions =
            matrix("% of the sphere", row, |a, b| fixed(100.0 * row.shared_directions[a][b], 1));
        // Rounded down, so that a requirement that is not met never reads as met.
        let up_to = (1e3 * row.overlap_up_to + 1e-9).floor() / 10.0;
        let up_to = match row.overlap_up_to > 0.0 {
            true => format!("All connected up to an overlap of {up_to:.1} %"),
            false => "No overlap connects all".to_owned(),
        };
        let verdict = format!("{}\n{up_to}", verdict(row));
        format!("{heading}\n{voxels}\n{overlap}\n{directions}\n{verdict}\n")
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}
