//! `--atlas`: what sensor poses cover, kept in a folder.

use std::path::Path;
use std::sync::Arc;

use sightline::search::atlas::{PageStore, StoreReport};

use super::Args;
use crate::cli::args::Talk;
use crate::cli::error::Error;

/// The store asked for.
pub(super) fn open(args: &Args) -> Result<Option<Arc<PageStore>>, Error> {
    let Some(folder) = &args.atlas else { return Ok(None) };
    let store = PageStore::open(folder, args.atlas_size).map_err(|error| {
        Error::Usage(format!(
            "--atlas {}: {error}; name a folder that exists or can be made",
            folder.display()
        ))
    })?;
    Ok(Some(Arc::new(store)))
}

/// Says what it was used for, and what was wrong with it.
pub(super) fn note(report: &StoreReport, folder: &Path, talk: Talk) {
    let StoreReport { read, written, spoilt, trouble } = report;
    let folder = folder.display();
    talk.detail(format!("{folder}: {read} sensor poses read, {written} written"));
    if *spoilt > 0 {
        talk.note(format!("{folder}: {spoilt} damaged or foreign file(s) were cast again"));
    }
    if let Some(trouble) = trouble {
        talk.note(format!("no more sensor poses are kept: {trouble}"));
    }
}
