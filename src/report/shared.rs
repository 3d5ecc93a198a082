//! Things by the number of LiDARs that see them, and the overlap of pairs, as text.

use super::text::align_columns;
use crate::json::fixed;
use crate::shared::{Overlap, Redundancy, SeenBy};
use crate::vehicle::SensorName;

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
        format!("{heading}\n{}", align_columns(&rows))
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
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

/// Two matrices a placement and scene, and whether pairs connect all LiDARs.
pub fn overlap_text(all: &[Overlap]) -> String {
    let of = |row: &Overlap| {
        let heading = heading(&row.scene, &row.placement, row.lidars.len(), row.frames);
        let voxels = matrix("surface voxels", row, |a, b| fixed(row.shared_voxels[a][b], 0));
        let directions =
            matrix("% of the sphere", row, |a, b| fixed(100.0 * row.shared_directions[a][b], 1));
        format!("{heading}\n{voxels}\n{directions}\n{}\n", verdict(row))
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}
