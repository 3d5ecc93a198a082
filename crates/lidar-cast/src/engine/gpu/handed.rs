//! A small batch as files in `target/kernels/batch`, for another implementation of WebGPU: `tests/browser` runs the same
//! kernels there and compares every word.
//!
//! `batch.json` lists the buffers (`file`, `bytes`, `made` by kernels or not) and the dispatches (`kernel`, `buffers` in the
//! order of the bindings, `groups`); a file beside it holds each buffer's final content.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use super::GpuBackend;
use crate::bvh::Bvh;
use crate::engine::{Backend, BackendError, CpuBackend};
use crate::geom::TriangleSoup;
use crate::grid::Roi;
use crate::sensor::{BeamTable, Placement, SensorPose};
use crate::task::{Content, OccupiedVoxel, Task};

/// Triangles in all directions, sensors that roll and pitch among them, two classes.
fn task() -> Arc<Task> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let roi = Roi::new([-8.0, -8.0, -3.0], [0.25; 3], [64, 64, 24]).unwrap();
    let mut soup = TriangleSoup::default();
    for face in 0..3000_u32 {
        let center = [(); 3].map(|()| rng.random_range(-7.0..7.0_f32));
        let corner = |rng: &mut ChaCha8Rng| center.map(|c| c + rng.random_range(-0.4..0.4_f32));
        soup.vertices.extend([corner(&mut rng), corner(&mut rng), corner(&mut rng)]);
        soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
        soup.face_class.push((face % 2) as u16);
    }
    let tree = Arc::new(Bvh::build(&soup, 30.0));
    let channels: Vec<(f64, f64)> = (0..16).map(|k| (-24.8 + 1.8 * f64::from(k), 0.1)).collect();
    let table = BeamTable::spinning(&channels, 250, 30.0).unwrap();
    let voxels = roi.voxel_count() as u32;
    let voxel = |index: u32| OccupiedVoxel { index, entropy: [1 + index % 977; 4] };
    let occupied: Vec<OccupiedVoxel> = (0..voxels).step_by(5).map(voxel).collect();
    let by_class = [3, 7].map(|step| (0..voxels).step_by(step).collect::<Vec<u32>>());
    let classes = ["vehicle", "building"].map(str::to_owned).to_vec();
    Arc::new(Task::new(
        roi,
        Content::new(classes, occupied, &by_class, false),
        table,
        vec![tree],
        true,
    ))
}

fn placements() -> Vec<Placement> {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut lidar = || {
        let [x, y, z] = [(); 3].map(|()| rng.random_range(-1.5..1.5));
        let [roll, pitch, yaw] = [(); 3].map(|()| rng.random_range(-0.3..0.3));
        SensorPose::from_values([x, y, z, roll, pitch, yaw])
    };
    (0..6)
        .map(|k| Placement {
            name: k.to_string(),
            lidars: (0..1 + k % 4).map(|_| lidar()).collect(),
        })
        .collect()
}

/// Left out where there is no device.
#[test]
fn kernels_are_handed_over_with_a_batch() {
    let (task, placements) = (task(), placements());
    let mut gpu = match GpuBackend::new(task.clone(), None, 1 << 28) {
        Err(BackendError::NoDevice { .. }) => return,
        gpu => gpu.unwrap(),
    };
    let made_by_device = gpu.tally(&placements, None).unwrap();
    assert_eq!(made_by_device, CpuBackend::new(task, 1 << 28).tally(&placements, None).unwrap());
    let work = gpu.work.as_ref().unwrap();
    let made = [&work.hits, &work.counters, &work.bitmaps, &work.totals, &work.partials];
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/kernels/batch");
    std::fs::create_dir_all(folder).unwrap();
    let mut buffers: Vec<wgpu::Buffer> = Vec::new();
    let mut dispatches = Vec::new();
    for (kernel, bound, groups) in gpu.kernels.noted.lock().unwrap().iter() {
        let mut number = |buffer: &wgpu::Buffer| {
            buffers.iter().position(|known| known == buffer).unwrap_or_else(|| {
                buffers.push(buffer.clone());
                buffers.len() - 1
            })
        };
        let bound: Vec<usize> = bound.iter().map(&mut number).collect();
        dispatches.push(json!({ "kernel": kernel, "buffers": bound, "groups": groups }));
    }
    assert_eq!(dispatches.len(), 5, "a kernel a stage, and three for the sums");
    let mut list = Vec::new();
    for (number, buffer) in buffers.iter().enumerate() {
        let file = format!("{number}.bin");
        let words: Vec<u8> = gpu.device.read("read-back", buffer, buffer.size()).unwrap();
        std::fs::write(format!("{folder}/{file}"), &words).unwrap();
        let made = made.contains(&buffer);
        assert!(!made || words.iter().any(|&byte| byte > 0), "buffer {number} is empty");
        list.push(json!({ "file": file, "bytes": words.len(), "made": made }));
    }
    let batch = json!({ "buffers": list, "dispatches": dispatches });
    std::fs::write(format!("{folder}/batch.json"), batch.to_string()).unwrap();
}
