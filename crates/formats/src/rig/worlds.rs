//! SDF worlds: the model that is the vehicle, among the ground, the houses and other robots.

use roxmltree::{Document, Node};
use sightline_files::Note;

use super::frames::FrameTree;
use super::{ImportSettings, RigError, import, sdf, yaml};

/// True for a model of the file or of its world; a `<state>` repeats names only.
fn is_outer(node: &Node) -> bool {
    let above = node.parent_element().map(|parent| parent.tag_name().name());
    node.has_tag_name("model") && matches!(above, Some("sdf" | "world" | "population"))
}

fn name<'a>(model: &Node<'a, '_>) -> &'a str {
    model.attribute("name").unwrap_or("without a name")
}

/// The model to read: the one of `--base-frame`, else the only one with LiDARs by type, else by the names of its links.
///
/// # Errors
/// No model, several with LiDARs, or LiDARs that only an included file may have.
pub(super) fn vehicle<'a, 'i>(
    document: &'a Document<'i>,
    file: &str,
    settings: &ImportSettings,
    frames: &mut FrameTree,
) -> Result<Node<'a, 'i>, RigError> {
    let models: Vec<Node> = document.descendants().filter(is_outer).collect();
    let included = included(document);
    let base = settings.base_frame.as_deref().unwrap_or_default();
    let is_meant = |model: &Node| {
        let rest = model.attribute("name").and_then(|name| base.strip_prefix(name));
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
    };
    let typed = |model: &Node| model.descendants().any(|node| sdf::is_lidar(node));
    let named = |model: &Node| {
        let links = model.descendants().filter(|node| node.has_tag_name("link"));
        links.filter_map(|link| link.attribute("name")).any(import::is_name_of_lidar)
    };
    let of = |is: &dyn Fn(&Node) -> bool| -> Vec<Node> {
        models.iter().copied().filter(|model| is(model)).collect()
    };
    let ways: [&dyn Fn(&Node) -> bool; 3] = [&is_meant, &typed, &named];
    let found = ways.iter().map(|way| of(*way)).find(|found| !found.is_empty());
    let nothing = found.is_none();
    let found = found.unwrap_or_else(|| models.clone());
    if nothing && settings.frames.is_empty() && !included.is_empty() {
        return Err(RigError::Included { file: file.to_owned(), included });
    }
    let Some(&model) = found.first() else {
        let at = Box::new(yaml::place(document.root_element(), file));
        return Err(RigError::Missing { at, key: "<model>".to_owned() });
    };
    if found.len() > 1 && !nothing {
        let models = found.iter().map(|model| name(model).to_owned()).collect();
        return Err(RigError::SeveralModels { file: file.to_owned(), models });
    }
    let others: Vec<&str> = models
        .iter()
        .filter(|other| **other != model)
        .map(name)
        .chain(included.iter().map(String::as_str))
        .collect();
    if !others.is_empty() {
        let text = format!(
            "{file}: of its models `{}` is read; left out are {}",
            name(&model),
            others.join(", ")
        );
        frames.notes.push(if nothing { Note::doubt(text) } else { Note::fact(text) });
    }
    note_pose(model, file, frames);
    Ok(model)
}

/// Addresses of the models that the world includes.
fn included(document: &Document) -> Vec<String> {
    let of_world = |node: &Node| {
        let above = node.parent_element().map(|parent| parent.tag_name().name());
        node.has_tag_name("include") && matches!(above, Some("sdf" | "world"))
    };
    let uri = |node: Node| {
        let uri = yaml::child(node, "uri").and_then(|uri| uri.text()).unwrap_or_default();
        format!("<include> of {}", uri.trim())
    };
    document.descendants().filter(of_world).map(uri).collect()
}

/// Says that the place of the model in its world is none of a LiDAR on it.
fn note_pose(model: Node, file: &str, frames: &mut FrameTree) {
    let text = yaml::child(model, "pose").and_then(|pose| pose.text()).unwrap_or_default();
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    if numbers.iter().any(|number| *number != 0.0) {
        let up = numbers.get(2).copied().unwrap_or_default();
        frames.notes.push(Note::fact(format!(
            "{file}: positions count from the frame of the model `{}`, not from the world, where it stands at {}; where \
             the ground is at z = 0, --base-link=0,0,{up} counts heights from it",
            name(&model),
            text.split_whitespace().collect::<Vec<_>>().join(" ")
        )));
    }
}
