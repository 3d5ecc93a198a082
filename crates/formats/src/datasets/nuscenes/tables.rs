//! Tables of nuScenes, read row by row: the whole set's tables are too large to hold in memory.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::fmt;
use std::io::{BufRead, BufReader, Read};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};
use lidar_cast::geom::Pose;
use serde::de::{DeserializeSeed, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use sightline_files::Note;
use sightline_files::files::stays_inside;
use sightline_files::json::{is_utf_16, quoted};

use crate::datasets::{Checked, FormatError, sequence};

/// Most bytes of a row; rows of nuScenes have up to 800.
const MOST_OF_A_ROW: usize = 1 << 20;
/// Most unknown names that a table keeps; a table of other things has one a row.
const MOST_KEPT: usize = 8;
/// Most characters of a name that are kept.
const LONGEST: usize = 40;
/// Farthest that the length of a quaternion may be from 1.
const UNIT: f64 = 1e-3;
/// Largest coordinate in metres.
const MOST_METRES: f64 = 1e7;

/// Fields that are passed over, table by table. The tables `log`, `map`, `attribute`, `visibility` and `panoptic` are not
/// read: they say where and how the set was recorded.
const PASSED: [(&str, &[&str]); 10] = [
    // Other rows say the same: a sample names its scene.
    ("scene", &["description", "log_token", "first_sample_token", "last_sample_token"]),
    // Times order the samples.
    ("sample", &["prev", "next"]),
    ("sensor", &["modality"]),
    // Cameras.
    ("calibrated_sensor", &["camera_intrinsic"]),
    // Pictures, and the times of sweeps.
    ("sample_data", &["timestamp", "fileformat", "height", "width", "prev", "next"]),
    ("ego_pose", &["timestamp"]),
    ("lidarseg", &["token"]),
    ("category", &["description"]),
    ("instance", &["nbr_annotations", "first_annotation_token", "last_annotation_token"]),
    // A box is an obstacle whoever sees it, and whatever it does.
    (
        "sample_annotation",
        &["visibility_token", "attribute_tokens", "num_lidar_pts", "num_radar_pts", "prev", "next"],
    ),
];
/// Table of categories that sets of Place3D have beside `category`.
pub(super) const LIDARSEG_CATEGORIES: &str = "lidarseg_category";

fn passed_over(table: &str) -> &'static [&'static str] {
    let table = if table == LIDARSEG_CATEGORIES { "category" } else { table };
    PASSED.iter().find(|(name, _)| *name == table).map_or(&[], |(_, fields)| fields)
}

pub(super) trait TableRow: for<'de> Deserialize<'de> {
    /// Its fields that are not read.
    fn others(&mut self) -> &mut BTreeMap<String, IgnoredAny>;
}

macro_rules! rows {
    ($($row:ident { $($field:ident: $kind:ty),* })*) => {$(
        #[derive(Deserialize)]
        pub(super) struct $row {
            $(pub $field: $kind,)*
            #[serde(flatten)]
            others: BTreeMap<String, IgnoredAny>,
        }

        impl TableRow for $row {
            fn others(&mut self) -> &mut BTreeMap<String, IgnoredAny> {
                &mut self.others
            }
        }
    )*};
}

// Times are microseconds, rotations quaternions w, x, y, z, sizes width, length, height. `index` is the label of lidarseg;
// sets without it lack the field.
rows! {
    SceneRow { token: String, name: String, nbr_samples: Option<serde_json::Value> }
    SampleRow { token: String, scene_token: String, timestamp: f64 }
    SensorRow { token: String, channel: String }
    CalibratedRow { token: String, sensor_token: String, translation: [f64; 3], rotation: [f64; 4] }
    SampleDataRow {
        token: String, sample_token: String, ego_pose_token: String, calibrated_sensor_token: String, filename: String,
        is_key_frame: bool
    }
    EgoPoseRow { token: String, translation: [f64; 3], rotation: [f64; 4] }
    LidarsegRow { sample_data_token: String, filename: String }
    CategoryRow { token: String, name: String, index: Option<u8> }
    InstanceRow { token: String, category_token: String }
    AnnotationRow {
        token: String, sample_token: String, instance_token: String, size: [f64; 3], translation: [f64; 3],
        rotation: [f64; 4]
    }
}

/// A row that others name by its token.
pub(super) trait TokenRow: TableRow {
    fn token(&self) -> &str;
}

macro_rules! by_token {
    ($($row:ident . $token:ident),*) => {$(
        impl TokenRow for $row {
            fn token(&self) -> &str {
                &self.$token
            }
        }
    )*};
}

by_token!(EgoPoseRow.token, InstanceRow.token, LidarsegRow.sample_data_token);

/// The folder of a version's tables.
pub(super) struct SourceTables {
    folder: PathBuf,
    /// Fields that are not known, a sentence a table.
    notes: RefCell<Vec<Note>>,
}

impl SourceTables {
    pub(super) fn new(folder: PathBuf) -> Self {
        Self { folder, notes: RefCell::default() }
    }

    /// Sentences on fields of the tables read so far that are neither read nor passed over.
    pub(super) fn notes(&self) -> Vec<Note> {
        self.notes.borrow().clone()
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.json"))
    }

    /// The file that a row names, in the folder of the set.
    pub(super) fn file(&self, table: &str, folder: &Path, name: &str) -> Checked<PathBuf> {
        stays_inside(folder, name)
            .map_err(|fault| refused!("{}: {fault}", self.path(table).display()))
    }

    /// Reads a table row by row; `keep` takes each row.
    pub(super) fn rows<R: TableRow>(
        &self,
        name: &str,
        mut keep: impl FnMut(R) -> Checked<()>,
    ) -> Checked<()> {
        let path = self.path(name);
        let file = sequence::open(&path).map_err(|error| match error {
            FormatError::Read { path, source } => FormatError::Table { path, source },
            other => other,
        })?;
        let (mut row, mut refused, mut unknown) = (0, None, BTreeSet::new());
        let left = Cell::new(MOST_OF_A_ROW);
        let each = EachRow {
            row: &mut row,
            refused: &mut refused,
            keep: &mut keep,
            left: &left,
            passed: passed_over(name),
            unknown: &mut unknown,
            rows: PhantomData::<R>,
        };
        let mut file = BufReader::new(file);
        let head = file.fill_buf();
        let head = head.map_err(|source| FormatError::Read { path: path.clone(), source })?;
        if is_utf_16(head) {
            return Err(sequence::not_utf_8(&path));
        }
        let marked = head.starts_with("\u{feff}".as_bytes());
        file.consume(if marked { "\u{feff}".len() } else { 0 });
        let metered = MeteredTable { file, left: &left };
        let mut json = serde_json::Deserializer::from_reader(metered);
        let read = each.deserialize(&mut json).and_then(|()| json.end());
        match (refused, read) {
            (Some(error), _) => Err(error),
            (None, Err(cause)) => Err(refused!(
                "{}: row {row}: {cause}; a table is a list of objects, as nuScenes has it",
                path.display()
            )),
            (None, Ok(())) if unknown.is_empty() => Ok(()),
            (None, Ok(())) => {
                let (path, names) = (path.display(), quoted(unknown));
                let text = format!("{path}: {names}: not known here, and not read.");
                self.notes.borrow_mut().push(Note::fact(text));
                Ok(())
            }
        }
    }

    /// The rows whose token is wanted; `wanted_by` names the table that wants them.
    pub(super) fn by_token<R: TokenRow>(
        &self,
        name: &str,
        wanted: &HashSet<&str>,
        wanted_by: &str,
    ) -> Checked<HashMap<String, R>> {
        let mut found = HashMap::new();
        self.rows(name, |row: R| {
            if wanted.contains(row.token()) {
                let token = row.token().to_owned();
                let again = found.insert(token.clone(), row).is_some();
                self.refuse_twice(name, &token, again)?;
            }
            Ok(())
        })?;
        match wanted.iter().filter(|token| !found.contains_key(**token)).min() {
            None => Ok(found),
            Some(missing) => Err(self.no_row(name, missing, wanted_by)),
        }
    }

    /// Refuses a row whose token comes `again`: nothing says which of the two counts.
    pub(super) fn refuse_twice(&self, name: &str, token: &str, again: bool) -> Checked<()> {
        match again {
            true => Err(self.refused(name, token, "it comes twice; leave one out")),
            false => Ok(()),
        }
    }

    /// Error of the row of a token.
    pub(super) fn refused(&self, name: &str, token: &str, fault: &str) -> FormatError {
        refused!("{}: the row {token:?}: {fault}", self.path(name).display())
    }

    /// The transform of a row: position, and a quaternion w, x, y, z.
    pub(super) fn pose(
        &self,
        name: &str,
        token: &str,
        translation: [f64; 3],
        [w, x, y, z]: [f64; 4],
    ) -> Checked<Pose> {
        let rotation = DQuat::from_xyzw(x, y, z, w);
        let fault = if (rotation.length() - 1.0).abs() > UNIT {
            "its rotation is no unit quaternion w, x, y, z"
        } else if translation.iter().any(|v| v.abs() > MOST_METRES) {
            "its translation is farther than 1e7 m"
        } else {
            let rotation = DMat3::from_quat(rotation.normalize());
            return Ok(Pose { rotation, translation: DVec3::from(translation) });
        };
        Err(self.refused(name, token, fault))
    }

    /// A row that another table names is not there.
    pub(super) fn no_row(&self, name: &str, token: &str, wanted: &str) -> FormatError {
        refused!(
            "{}: has no row for {token:?}, which {wanted} names; take all tables from one version of the set",
            self.path(name).display()
        )
    }
}

/// Visits the rows of a list one by one.
struct EachRow<'a, R, F> {
    row: &'a mut usize,
    refused: &'a mut Option<FormatError>,
    keep: &'a mut F,
    left: &'a Cell<usize>,
    passed: &'static [&'static str],
    /// Names of fields that are neither read nor passed over.
    unknown: &'a mut BTreeSet<String>,
    rows: PhantomData<R>,
}

/// A table that ends with an error where a row is longer than any row is: a text without an end would fill memory.
struct MeteredTable<'a, R> {
    file: R,
    /// Bytes that the row may still take.
    left: &'a Cell<usize>,
}

impl<R: Read> Read for MeteredTable<'_, R> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let most = to.len().min(self.left.get());
        if most == 0 && !to.is_empty() {
            let words = format!("is longer than {} KiB", MOST_OF_A_ROW >> 10);
            return Err(std::io::Error::other(words));
        }
        let read = self.file.read(&mut to[..most])?;
        self.left.set(self.left.get() - read);
        Ok(read)
    }
}

impl<'de, R, F> DeserializeSeed<'de> for EachRow<'_, R, F>
where
    R: TableRow,
    F: FnMut(R) -> Checked<()>,
{
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, R, F> Visitor<'de> for EachRow<'_, R, F>
where
    R: TableRow,
    F: FnMut(R) -> Checked<()>,
{
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of rows")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut rows: A) -> Result<(), A::Error> {
        while let Some(mut row) = rows.next_element::<R>()? {
            for name in std::mem::take(row.others()).into_keys() {
                if !self.passed.contains(&name.as_str()) && self.unknown.len() < MOST_KEPT {
                    self.unknown.insert(name.escape_debug().take(LONGEST).collect());
                }
            }
            if let Err(error) = (self.keep)(row) {
                *self.refused = Some(error);
                return Err(serde::de::Error::custom("refused"));
            }
            *self.row += 1;
            self.left.set(MOST_OF_A_ROW);
        }
        Ok(())
    }
}
