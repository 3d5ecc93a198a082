//! Threads of the process: as many as are asked for, and no more than are useful.

/// Threads for each core that are still useful.
const A_CORE: usize = 4;
/// Threads that any machine may be asked for.
const ANY_MACHINE: usize = 16;
/// Variables that rayon takes the number of its threads from.
const VARIABLES: [&str; 2] = ["RAYON_NUM_THREADS", "RAYON_RS_NUM_CPUS"];

/// Most threads that this machine is given: four a core, and at least 16.
pub fn most() -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    (A_CORE * cores).max(ANY_MACHINE)
}

/// Starts so many threads, at most [`most`], for all work to come, and returns their number.
///
/// # Errors
/// Threads that were started before, or that the system does not give.
pub fn start(wanted: usize) -> Result<usize, rayon::ThreadPoolBuildError> {
    let threads = wanted.clamp(1, most());
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    Ok(threads)
}

/// Number of threads that the environment asks for, where it is more than [`most`].
pub fn too_many_by_environment() -> Option<usize> {
    let number = |name: &&str| std::env::var(name).ok()?.parse::<usize>().ok();
    VARIABLES.iter().find_map(number).filter(|&wanted| wanted > most())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_machine_gets_more_threads_than_are_useful() {
        assert!((16..65_535).contains(&most()));
        assert!(start(65_535).is_ok_and(|threads| threads == most()) || start(1).is_err());
    }
}
