//! JSON Schemas (2020-12) of the files that users write, made from the types that read them.

use schemars::{Schema, schema_for};
use serde_json::{Value, json};
use sightline_files::json::FileKind;

use crate::scene::description::{BodyDescription, SceneDescription, ShapeDescription};
use crate::scene::target::TargetDescription;
use crate::vehicle::VehicleDescription;
use crate::vehicle::placement_file::PlacementFile;

/// JSON Schema of a kind of file. It knows keys and types; rules on values and between keys are checked on reading alone.
pub fn schema(kind: FileKind) -> Value {
    let mut schema = match kind {
        FileKind::Scene => schema_for!(SceneDescription),
        FileKind::Vehicle => of_vehicle_file(),
        FileKind::Placements => schema_for!(PlacementFile),
        FileKind::Target => schema_for!(TargetDescription),
    };
    schema.insert("title".to_owned(), json!(format!("sightline: {kind}")));
    schema.to_value()
}

/// A vehicle in a scene needs no version, one in a file does.
fn of_vehicle_file() -> Schema {
    let mut schema = schema_for!(VehicleDescription<ShapeDescription, BodyDescription>);
    if let Some(Value::Array(required)) = schema.get_mut("required") {
        required.push(json!("sightline"));
    }
    schema
}
