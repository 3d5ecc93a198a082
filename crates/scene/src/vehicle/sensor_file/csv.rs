//! Sensor files with a line a beam: CSV of Hesai, Livox and RoboSense.

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

use sightline_files::Note;
use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location};

use super::pattern::{
    self, Beams, MAX_BEAMS, SensorFormat, SensorPattern, azimuth, channel, check_count, direction,
    quoted,
};

/// Most cells of a row that are looked at; tables of sensors have up to five.
const MOST_CELLS: usize = 32;

/// Rows with their lines, counted from 1; cells without blanks and quotes. Rows without a value are left out.
pub(super) fn rows(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    // Old spreadsheets end lines by a carriage return alone; other programs may add lines of theirs.
    let lines =
        text.split('\n').flat_map(|line| line.strip_suffix('\r').unwrap_or(line).split('\r'));
    let rows = lines.enumerate().map(|(i, line)| (i + 1, cells_of(line)));
    let rows = rows.filter(|(_, cells)| cells.iter().any(|cell| !cell.is_empty()));
    rows.filter_map(|(line, cells)| Some((line, without_hash(cells)?)))
}

/// A row, without the `#` before two or more known titles; `None` for a comment.
fn without_hash(mut cells: Vec<&str>) -> Option<Vec<&str>> {
    let Some(first) = cells[0].strip_prefix('#') else { return Some(cells) };
    cells[0] = first.trim();
    let known = || HESAI_TITLES.iter().chain(&LIVOX_TITLES);
    let is_title = |cell: &&str| known().any(|title| begins(cell, title));
    (cells.len() > 1 && cells.iter().all(is_title)).then_some(cells)
}

/// A comma at the end begins no cell: spreadsheets write one behind the last column.
fn cells_of(line: &str) -> Vec<&str> {
    let line = line.trim_end();
    line.strip_suffix(',')
        .unwrap_or(line)
        .split(',')
        .take(MOST_CELLS)
        .map(|cell| cell.trim().trim_matches('"').trim())
        .collect()
}

/// True if a row is the version that Hesai writes above some tables: `EEFF,1,1`.
pub(super) fn is_version(cells: &[&str]) -> bool {
    cells[0].eq_ignore_ascii_case("eeff")
}

/// The column whose title begins with `title`, whatever its case.
pub(super) fn column(cells: &[&str], title: &str) -> Option<usize> {
    cells.iter().position(|cell| begins(cell, title))
}

/// The only column whose title begins with `title`.
///
/// # Errors
/// A second such column: nothing says which of the two counts.
fn sole_column(at: &Location, titles: &[&str], title: &str) -> Checked<Option<usize>> {
    let found = column(titles, title);
    let next = found.map_or(titles.len(), |first| first + 1);
    match titles[next..].iter().find(|cell| begins(cell, title)) {
        Some(second) => {
            let wanted = format!(
                "the only column of that title; {:?} is another, delete one",
                titles[next - 1]
            );
            Err(bad(at, quoted(second), wanted))
        }
        None => Ok(found),
    }
}

fn needed_column(at: &Location, titles: &[&str], title: &str) -> Checked<usize> {
    sole_column(at, titles, title)?.ok_or_else(|| {
        bad(at, quoted(&titles.join(",")), format!("a row of titles with `{title}`"))
    })
}

/// True if a title begins with a word, whatever its case.
fn begins(cell: &str, word: &str) -> bool {
    cell.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word))
}

/// Titles that begin with none of the known words and name something.
fn unknown<'a>(titles: &[&'a str], known: &[&str]) -> Vec<&'a str> {
    let is_known = |title: &str| title.is_empty() || known.iter().any(|word| begins(title, word));
    titles.iter().copied().filter(|title| !is_known(title)).collect()
}

/// Words of a unit in brackets or behind a slash that is not degrees.
const NO_DEGREES: [&str; 12] =
    ["gon", "arc", "min", "sec", "mil", "centi", "turn", "cdeg", "mdeg", "0.1", "0.01", "100"];

/// Refuses a column whose title names radians, or parts of a degree; tables of vendors have degrees.
fn in_degrees(at: &Location, title: &str) -> Checked<()> {
    let small = title.to_ascii_lowercase();
    let unit = small.split_once(['(', '[', '/']).map_or("", |(_, unit)| unit);
    if small.contains("rad") || NO_DEGREES.iter().any(|word| unit.contains(word)) {
        return Err(bad(at, quoted(title), "a column of degrees; convert it"));
    }
    Ok(())
}

/// Refuses a title of azimuths that count the other way than Hesai's.
fn clockwise(at: &Location, title: &str) -> Checked<()> {
    let small = title.to_ascii_lowercase();
    if small.contains("ccw") || small.contains("counter") {
        let wanted = "a column of azimuths that count clockwise; turn their signs, and the title";
        return Err(bad(at, quoted(title), wanted));
    }
    Ok(())
}

pub(super) fn at_line(at: &Location, number: usize) -> Location {
    at.key(&format!("line {number}"))
}

/// Refuses a row with more cells than there are columns: decimal commas split numbers.
fn check_width(at: &Location, cells: &[&str], columns: usize) -> Checked<()> {
    match cells.iter().skip(columns).find(|cell| !cell.is_empty()) {
        None => Ok(()),
        Some(_) => {
            let wanted = format!("a row of {columns} columns; write decimals with a point, as 1.5");
            Err(bad(at, quoted(&cells.join(",")), wanted))
        }
    }
}

fn number_in(at: &Location, cells: &[&str], column: usize) -> Checked<f64> {
    let cell = cells.get(column).copied().unwrap_or_default();
    match cell.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(bad(at, quoted(cell), format!("a number in column {}, as 1.5", column + 1))),
    }
}

/// Titles that are read, and of the channel's number.
const HESAI_TITLES: [&str; 4] = ["elevation", "azimuth", "channel", "laser"];

pub(super) fn parse_hesai(at: &Location, text: &str) -> Checked<SensorPattern> {
    let mut rows = rows(text).filter(|(_, cells)| !is_version(cells));
    let (line, titles) = rows.next().unwrap_or_default();
    let title_at = at_line(at, line);
    let find = |title| {
        let column = needed_column(&title_at, &titles, title)?;
        in_degrees(&title_at, titles[column]).map(|()| column)
    };
    let elevation = find("elevation")?;
    if let Some(time) = column(&titles, "time") {
        let wanted = "a column of channels; a pattern with times has the titles `Time,Azimuth,Zenith`, and its zenith angle is 90° \
                      less the elevation";
        return Err(bad(&title_at, quoted(titles[time]), wanted));
    }
    // A title that is not known may be one of offsets.
    let has_offsets = column(&titles, "azimuth").is_some();
    let strange = unknown(&titles, &HESAI_TITLES);
    if !has_offsets && !strange.is_empty() {
        let wanted = "a row of known titles: write `Channel,Elevation,Azimuth`, or delete the row above a plain list of \
                      elevations in degrees";
        return Err(bad(&title_at, quoted(&titles.join(",")), wanted));
    }
    let azimuth = if has_offsets { Some(find("azimuth")?) } else { None };
    azimuth.map_or(Ok(()), |column| clockwise(&title_at, titles[column]))?;
    let of_channel = sole_column(&title_at, &titles, "channel")?;
    let number = of_channel.or(sole_column(&title_at, &titles, "laser")?);
    let mut numbers = BTreeSet::new();
    let mut channels = Vec::new();
    for (line, cells) in rows.filter(|(_, cells)| !is_checksum(cells)) {
        let at = at_line(at, line);
        check_width(&at, &cells, titles.len())?;
        if let Some(column) = number {
            let number = number_in(&at, &cells, column)?;
            // Adding 0 makes 0 of -0.
            if !numbers.insert((number + 0.0).to_bits()) {
                return Err(bad(&at, format!("channel {number}"), "listed once; it comes twice"));
            }
        }
        let up = number_in(&at, &cells, elevation)?;
        // Subtracting turns the sign without making -0 of 0.
        let offset = match azimuth {
            Some(azimuth) => 0.0 - number_in(&at, &cells, azimuth)?,
            None => 0.0,
        };
        channels.push(channel((&at, up), (&at, offset))?);
    }
    check_count(at, channels.len())?;
    let mut notes = Vec::new();
    notes.extend(pattern::unread(&title_at, &strange));
    if azimuth.is_none() {
        notes.push(Note::fact(format!("{title_at}: has no column `Azimuth`; offsets are 0")));
    }
    notes.extend(gap(at, &numbers));
    Ok(SensorPattern {
        notes,
        ..SensorPattern::new(SensorFormat::Hesai, Beams::Channels(channels))
    })
}

/// A doubt where channels are numbered from 0 or 1 on and one is left out.
fn gap(at: &Location, numbers: &BTreeSet<u64>) -> Option<Note> {
    let sorted = || numbers.iter().map(|bits| f64::from_bits(*bits));
    let (first, last) = (sorted().fold(f64::INFINITY, f64::min), sorted().fold(0.0, f64::max));
    let span = last - first + 1.0;
    let text = format!(
        "{at}: lists {} channels, numbered from {first} to {last}: are {} left out?",
        numbers.len(),
        span - numbers.len() as f64
    );
    (!numbers.is_empty() && span > numbers.len() as f64).then(|| Note::doubt(text))
}

/// True if a row is the SHA-256 of the rows above it.
fn is_checksum(cells: &[&str]) -> bool {
    let is_hash = |cell: &str| cell.len() == 64 && cell.bytes().all(|b| b.is_ascii_hexdigit());
    is_hash(cells[0]) && cells[1..].iter().all(|cell| cell.is_empty())
}

/// Seconds of a frame, unless a window is given.
const FRAME: f64 = 0.1;
/// Columns of a pattern without titles.
const LIVOX_COLUMNS: [usize; 3] = [0, 1, 2];
/// Titles that are read.
const LIVOX_TITLES: [&str; 3] = ["time", "azimuth", "zenith"];

pub(super) fn parse_livox(
    at: &Location,
    text: &str,
    window: Option<[f64; 2]>,
) -> Checked<SensorPattern> {
    let mut rows = rows(text).peekable();
    let (mut notes, mut width) = (Vec::new(), LIVOX_COLUMNS.len());
    let is_titled = rows.peek().is_some_and(|(_, cells)| column(cells, "zenith").is_some());
    let (columns, in_seconds) = match rows.peek() {
        Some((line, cells)) if is_titled => {
            let title_at = at_line(at, *line);
            let found = columns_of(&title_at, cells)?;
            notes.extend(pattern::unread(&title_at, &unknown(cells, &LIVOX_TITLES)));
            width = cells.len();
            rows.next();
            found
        }
        _ => (LIVOX_COLUMNS, false),
    };
    let mut samples: Vec<[f64; 3]> = Vec::new();
    let mut largest = [0.0_f64; 2];
    for (line, cells) in rows {
        let at = at_line(at, line);
        check_width(&at, &cells, width)?;
        let [time, across, zenith] = columns.map(|column| number_in(&at, &cells, column));
        let (time, across, zenith) = (time?, azimuth(&at, across?)?, zenith?);
        if !(0.0..=180.0).contains(&zenith) {
            return Err(bad(&at, zenith, "a zenith angle from 0 to 180 degrees"));
        }
        samples.push([time, across, zenith]);
        largest = [largest[0].max(across.abs()), largest[1].max(zenith)];
    }
    refuse_numbers_of_channels(at, &samples, is_titled || window.is_some())?;
    // Rows may stand in any order of time.
    let first = samples.iter().map(|sample| sample[0]).reduce(f64::min).unwrap_or_default();
    let [from, to] = window.unwrap_or([first, first + FRAME]);
    let inside = samples.iter().filter(|[time, ..]| (from..to).contains(time));
    let directions: Vec<[f64; 3]> =
        inside.map(|[_, across, zenith]| direction(*across, 90.0 - zenith)).collect();
    // A window is in the unit of the times, whichever it is.
    let unlike_seconds = window.is_none() && is_unlike_seconds(&samples, first);
    let is_sparse = samples.len() >= 1000 && directions.len() < 10;
    let unlike_seconds = !in_seconds && (is_sparse || unlike_seconds);
    let samples = samples.len() as u64;
    if directions.is_empty() || directions.len() as u64 > MAX_BEAMS {
        let found = format!("{} of {samples} samples from {from} to {to} s", directions.len());
        return Err(bad(at, found, format!("a frame of 1 to {MAX_BEAMS} beams; give a `window`")));
    }
    notes.insert(
        0,
        Note::fact(format!(
            "The frame is the window from {from} to {to} s: {} of {samples} samples. The sensor goes on with \
             others; here every frame has these.",
            directions.len()
        )),
    );
    notes.extend(doubts(at, largest, [directions.len() as u64, samples], unlike_seconds));
    let beams = Beams::Directions(directions);
    Ok(SensorPattern { notes, ..SensorPattern::new(SensorFormat::Livox, beams) })
}

/// Refuses times that count by one, as channels do: the first 0.1 s of them would be one beam.
fn refuse_numbers_of_channels(at: &Location, samples: &[[f64; 3]], is_known: bool) -> Checked<()> {
    if is_known || samples.len() < 2 || samples.windows(2).any(|two| two[1][0] - two[0][0] != 1.0) {
        return Ok(());
    }
    let wanted = "a column that a title explains; write `Channel,Elevation,Azimuth` or `Time,Azimuth,Zenith` above";
    Err(bad(at, "a first column that counts by one", wanted))
}

/// Units that most likely are not degrees and seconds: azimuths within 2π and zeniths within π, and times as found.
fn doubts(
    at: &Location,
    [across, zenith]: [f64; 2],
    [taken, samples]: [u64; 2],
    unlike_seconds: bool,
) -> Vec<Note> {
    let mut notes = Vec::new();
    // In degrees all samples would look straight up, within 3°.
    if zenith > 0.0 && across <= TAU && zenith <= PI {
        notes.push(Note::doubt(format!(
            "{at}: azimuths reach {across:.3} and zenith angles {zenith:.3} degrees: radians? Write degrees."
        )));
    }
    if unlike_seconds {
        notes.push(Note::doubt(format!(
            "{at}: {taken} of {samples} samples lie in the frame: are times in seconds? Convert them, or give a `window`."
        )));
    }
    notes
}

/// Fewest samples a second of a pattern: Livox sensors measure 100 000 and more.
const FEWEST_A_SECOND: f64 = 500.0;
/// Fewest samples that tell a unit of their times.
const FEWEST_OF_A_UNIT: usize = 100;

/// True if times are most likely in a smaller unit, such as `offset_time` in nanoseconds: all are whole numbers, or there is
/// next to no sample a second.
fn is_unlike_seconds(samples: &[[f64; 3]], first: f64) -> bool {
    let last = samples.iter().map(|sample| sample[0]).fold(first, f64::max);
    let is_whole = samples.iter().all(|sample| sample[0].fract() == 0.0);
    let rate = samples.len() as f64 / (last - first);
    samples.len() >= FEWEST_OF_A_UNIT && last > first && (is_whole || rate < FEWEST_A_SECOND)
}

/// Columns of time, azimuth and zenith by their titles; true if seconds are stated, as in `Time/s`.
fn columns_of(at: &Location, titles: &[&str]) -> Checked<([usize; 3], bool)> {
    let find = |title| needed_column(at, titles, title);
    let columns = [find("time")?, find("azimuth")?, find("zenith")?];
    let title = titles[columns[0]].to_ascii_lowercase();
    let words = || title.split(|c: char| !c.is_alphabetic());
    let small = ["ms", "us", "µs", "ns", "msec", "usec", "nsec"];
    if words().any(|word| small.contains(&word.trim_start_matches("time"))) {
        return Err(bad(at, quoted(titles[columns[0]]), "a column of seconds; convert it"));
    }
    columns[1..].iter().try_for_each(|&column| in_degrees(at, titles[column]))?;
    let seconds = ["s", "sec", "secs", "second", "seconds"];
    Ok((columns, words().any(|word| seconds.contains(&word))))
}

pub(super) fn parse_robosense(at: &Location, text: &str) -> Checked<SensorPattern> {
    let mut channels = Vec::new();
    let mut columns = None;
    for (line, cells) in rows(text) {
        let at = at_line(at, line);
        let wanted = *columns.get_or_insert(cells.len());
        if cells.len() != wanted {
            let wanted = format!("a row of {wanted} columns, as the first one");
            return Err(bad(&at, quoted(&cells.join(",")), wanted));
        }
        let elevation = number_in(&at, &cells, 0)?;
        // Subtracting turns the sign without making -0 of 0.
        let offset = if wanted == 2 { 0.0 - number_in(&at, &cells, 1)? } else { 0.0 };
        channels.push(channel((&at, elevation), (&at, offset))?);
    }
    check_count(at, channels.len())?;
    let notes = decimal_commas(at, text).into_iter().collect();
    let pattern = SensorPattern::new(SensorFormat::RoboSense, Beams::Channels(channels));
    Ok(SensorPattern { notes, ..pattern })
}

/// A doubt about rows of two whole numbers, the second with as many digits in each and not 0 in all: one number with a decimal
/// comma may be meant.
fn decimal_commas(at: &Location, text: &str) -> Option<Note> {
    let rows: Vec<_> = rows(text).collect();
    let is_whole = |cell: &&str| cell.trim_start_matches('-').bytes().all(|b| b.is_ascii_digit());
    let digits = |cells: &[&str]| match cells {
        [first, second] if is_whole(first) && !second.starts_with('-') && is_whole(second) => {
            Some(second.len())
        }
        _ => None,
    };
    let length = digits(&rows.first()?.1)?;
    let alike = rows.iter().all(|(_, cells)| digits(cells) == Some(length));
    let turned = rows.iter().find(|(_, cells)| cells[1].bytes().any(|b| b != b'0'))?;
    let [elevation, offset] = [turned.1[0], turned.1[1]];
    (alike && rows.len() > 1).then(|| {
        Note::doubt(format!(
            "{}: {elevation},{offset} is read as an elevation of {elevation}° and an azimuth offset of {offset}°; a decimal \
             comma? Write {elevation}.{offset}",
            at_line(at, turned.0)
        ))
    })
}
