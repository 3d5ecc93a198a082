//! Sets the cfg `has_golden` where the golden traces lie, so that a checkout without them lists the
//! test as ignored.

use std::env;
use std::path::PathBuf;

fn main() {
    println!("cargo::rustc-check-cfg=cfg(has_golden)");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=SIGHTLINE_GOLDEN");
    let folder = env::var_os("SIGHTLINE_GOLDEN").unwrap_or("../../../shared/golden".into());
    let traces = PathBuf::from(folder).join("cma_tell.json");
    if traces.is_file() {
        println!("cargo::rustc-cfg=has_golden");
        // A path that does not exist would make every build start anew.
        println!("cargo::rerun-if-changed={}", traces.display());
    }
}
