//! `--figures DIR`: each figure as a file of its own, the same bytes that other options write.

use crate::cli::*;
use crate::cli_files::{all_files, world};

/// Runs a command, and returns the last line that it tells.
fn run(dir: &Path, line: &str) -> String {
    stderr(dir, line).lines().last().unwrap_or_default().to_owned()
}

fn names(dir: &Path) -> Vec<String> {
    let entries = fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name());
    let mut names: Vec<String> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn studies_write_the_drawing_of_each_placement() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    let placements = fs::read_to_string(at("p.json")).unwrap();
    let lidars = &placements[placements.find('[').unwrap() + 1..placements.rfind(']').unwrap()];
    let two = format!("{{\"placements\": [{lidars}, {}]}}", lidars.replace("\"p\"", "\"q\""));
    fs::write(at("two.json"), two).unwrap();
    for (line, name) in [
        ("study nearfield town.json", "near-field"),
        ("study targets --target car --distances 5,10 town.json", "targets"),
        ("study sweep --of 0.z --from 2 --to 2.4 --values 2 town.json", "sweep"),
    ] {
        let line_of_one = format!("{line} p.json --backend cpu --out one.svg --figures one");
        let told = run(dir.path(), &line_of_one);
        assert_eq!(told, "sightline: wrote one.svg, 1 figure and 1 table in one", "{line}");
        let scene = if name == "targets" { "-in-town" } else { "" };
        let table = format!("{name}.csv");
        let mut wanted = [format!("{name}-p{scene}.svg"), table.clone()];
        wanted.sort();
        assert_eq!(names(&at("one")), wanted, "{line}");
        let one = fs::read(at("one").join(format!("{name}-p{scene}.svg"))).unwrap();
        assert!(one == fs::read(at("one.svg")).unwrap() && one.starts_with(b"<svg"), "{line}");
        let told = run(dir.path(), &format!("{line} two.json --backend cpu --figures two"));
        assert_eq!(told, "sightline: wrote 2 figures and 1 table in two", "{line}");
        let drawn = [format!("{name}-p{scene}.svg"), format!("{name}-q{scene}.svg")];
        let mut wanted = [drawn[0].clone(), drawn[1].clone(), table.clone()];
        wanted.sort();
        assert_eq!(names(&at("two")), wanted, "{line}");
        let printed = stdout(dir.path(), &format!("{line} two.json --backend cpu --format csv"));
        assert_eq!(fs::read_to_string(at("two").join(table)).unwrap(), printed, "{line}");
        // The second one differs by its name alone.
        let second = fs::read_to_string(at("two").join(&drawn[1])).unwrap();
        assert!(second.contains(">q") && !second.contains(">p<"), "{line}");
        fs::remove_dir_all(at("one")).unwrap();
        fs::remove_dir_all(at("two")).unwrap();
        fs::remove_file(at("one.svg")).unwrap();
    }
}

#[test]
fn commands_without_a_figure_write_the_table_that_they_print() {
    let dir = crate::cli_csv::town();
    let at = |name: &str| dir.path().join(name);
    for (line, name) in [
        ("score town.json two.json", "scores"),
        ("score town.json town2.json two.json", "scores"),
        ("score town.json two.json --out scores.json --format json", "scores"),
        ("study redundancy town.json two.json", "redundancy"),
        ("study overlap town.json two.json", "overlap"),
        ("study tolerance town.json two.json --vehicle cart.json --steps 1", "tolerance"),
    ] {
        let (start, _) = line.split_once(" --out").unwrap_or((line, ""));
        let told = stderr(dir.path(), &format!("{line} --backend cpu --figures tables"));
        assert!(told.contains("wrote 1 table in tables"), "{line}: {told}");
        assert_eq!(names(&at("tables")), [format!("{name}.csv")], "{line}");
        let printed = stdout(dir.path(), &format!("{start} --backend cpu --format csv"));
        let written = fs::read_to_string(at("tables").join(format!("{name}.csv"))).unwrap();
        assert!(written == printed && written.lines().count() > 1, "{line}: {written}");
        fs::remove_dir_all(at("tables")).unwrap();
    }
    let line = "score town.json p.json --out scores.json --resume --figures tables";
    fails(dir.path(), line).says("--figures: needs all scores").says("leave one of them out");
    assert!(!at("tables").exists());
}

#[test]
fn a_search_and_a_view_write_the_figures_of_their_page() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    let line = "optimize town.json --backend cpu --evaluations 8 --out run --figures run/figures";
    run(dir.path(), line);
    let all =
        ["convergence", "information-town", "lidars-town", "near-field", "placement", "range-card"];
    let mut files = all.map(|name| format!("{name}.svg")).to_vec();
    files.push("result.csv".to_owned());
    files.sort();
    assert_eq!(names(&at("run/figures")), files);
    for (figure, file) in [
        ("convergence.svg", "convergence.svg"),
        ("placement.svg", "placement.svg"),
        ("information-town.svg", "map.svg"),
    ] {
        let read = |path: &Path| fs::read(path).unwrap();
        assert_eq!(read(&at("run/figures").join(figure)), read(&at("run").join(file)), "{figure}");
    }
    let told =
        run(dir.path(), "view town.json p.json --backend cpu --out view.html --figures view");
    assert_eq!(told, "sightline: wrote view.html, 5 figures in view");
    let without = all[1..].iter().map(|name| format!("{name}.svg")).collect::<Vec<_>>();
    assert_eq!(names(&at("view")), without);
}

#[test]
fn a_front_writes_its_picture() {
    let dir = tempfile::TempDir::new().unwrap();
    crate::front::street(dir.path(), [30, 11], json!([]));
    let at = |name: &str| dir.path().join(name);
    let line = "optimize street.json --front price,near_gain --backend cpu --evaluations 0 --out run --figures";
    run(dir.path(), &format!("{line} figures"));
    assert_eq!(names(&at("figures")), ["front.csv", "front.svg"]);
    assert_eq!(fs::read(at("figures/front.svg")).unwrap(), fs::read(at("run/front.svg")).unwrap());
    // A finished front draws it again.
    run(dir.path(), "optimize --resume run --backend cpu --figures again");
    assert_eq!(names(&at("again")), ["front.csv", "front.svg"]);
    let line = line.replace("--out run", "--out other") + " other";
    fails(&dir, &line).says("--figures other: is the folder of the run");
    assert!(!at("other").exists());
}

#[test]
fn folders_that_are_taken_are_refused_before_the_work() {
    let dir = world();
    let before = all_files(dir.path());
    for line in [
        "study nearfield town.json p.json --backend cpu --figures .",
        "study redundancy town.json p.json --backend cpu --figures .",
        "study overlap town.json p.json --backend cpu --figures .",
        "score town.json p.json --backend cpu --figures .",
        "view town.json p.json --backend cpu --out v.html --figures .",
        "optimize town.json --backend cpu --evaluations 8 --out run --figures .",
    ] {
        fails(&dir, line).says("is not empty");
    }
    fails(&dir, "optimize town.json --backend cpu --evaluations 8 --out run --figures run")
        .says("--figures run: is the folder of the run");
    fails(&dir, "study targets town.json p.json --backend cpu --figures p.json --force")
        .says("is read by this command");
    fails(&dir, "study nearfield town.json p.json --backend cpu --figures . --force")
        .says("which this command reads");
    assert_eq!(all_files(dir.path()), before);
}
