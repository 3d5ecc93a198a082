//! Tables of nuScenes while they are written: lists of objects, one a line.

use std::io::Write;

use serde_json::Value;

use crate::export::ExportError;
use crate::export::folder::{Folder, Staged};

/// A table that is being written.
pub(super) struct Table {
    staged: Staged,
    empty: bool,
}

impl Table {
    pub fn begin(folder: &Folder, version: &str, name: &str) -> Result<Self, ExportError> {
        let staged = folder.begin(&format!("{version}/{name}.json"))?;
        Ok(Self { staged, empty: true })
    }

    pub fn push(&mut self, row: &Value) -> Result<(), ExportError> {
        let before: &[u8] = if std::mem::take(&mut self.empty) { b"[\n" } else { b",\n" };
        self.staged.write(|out| {
            out.write_all(before)?;
            Ok(serde_json::to_writer(out, row)?)
        })
    }

    pub fn end(mut self) -> Result<(), ExportError> {
        let end: &[u8] = if self.empty { b"[]\n" } else { b"\n]\n" };
        self.staged.write(|out| out.write_all(end))?;
        self.staged.end().map(drop)
    }
}

/// Tables that grow with scenes and frames.
pub(super) struct Tables {
    pub calibrated_sensor: Table,
    pub ego_pose: Table,
    pub instance: Table,
    pub lidarseg: Table,
    pub log: Table,
    pub sample: Table,
    pub sample_annotation: Table,
    pub sample_data: Table,
    pub scene: Table,
}

impl Tables {
    /// Begins all of them.
    pub fn begin(folder: &Folder, version: &str) -> Result<Self, ExportError> {
        let table = |name: &str| Table::begin(folder, version, name);
        Ok(Self {
            calibrated_sensor: table("calibrated_sensor")?,
            ego_pose: table("ego_pose")?,
            instance: table("instance")?,
            lidarseg: table("lidarseg")?,
            log: table("log")?,
            sample: table("sample")?,
            sample_annotation: table("sample_annotation")?,
            sample_data: table("sample_data")?,
            scene: table("scene")?,
        })
    }

    /// Ends all of them.
    pub fn end(self) -> Result<(), ExportError> {
        self.calibrated_sensor.end()?;
        self.ego_pose.end()?;
        self.instance.end()?;
        self.lidarseg.end()?;
        self.log.end()?;
        self.sample.end()?;
        self.sample_annotation.end()?;
        self.sample_data.end()?;
        self.scene.end()
    }
}
