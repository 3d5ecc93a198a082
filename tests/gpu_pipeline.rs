//! The pipeline: batches of many chunks and frames, whose steps overlap on the device, against the CPU.

use sightline::engine::gpu::GpuBackend;

use crate::common::*;

const RANGE: f64 = 100.0;

/// Triangles one behind the other whose boxes all begin at the origin: beams towards them take more
/// steps than an invocation may, and are left to the host.
fn many_steps(shift: f32) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    for face in 0..4000_u32 {
        let far = 6.0 + shift - face as f32 * 1e-4;
        soup.vertices.extend([[0.0, -50.0, -50.0], [far, 50.0, -50.0], [far, 50.0, 50.0]]);
        soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
        soup.face_class.push((face % 3) as u16);
    }
    soup
}

/// Six frames, of which the first, the third and the last leave beams to the host; two are equal.
fn problem() -> Arc<Problem> {
    let roi = Roi::new([-6.0, -5.0, -3.25], [0.5; 3], [24, 20, 13]).unwrap();
    let table = BeamTable::spinning(&[(-20.0, 0.0), (-3.0, 0.2), (9.0, 0.1)], 21, RANGE).unwrap();
    let tree = |soup: &TriangleSoup| Arc::new(Bvh::build(soup, RANGE as f32));
    let plain = tree(&random_soup(91, 200, 6.0));
    let other = tree(&random_soup(92, 200, 6.0));
    let steps = [0.0, 0.7, -0.9].map(|shift| tree(&many_steps(shift)));
    let [first, third, last] = steps;
    let frames = vec![first, plain.clone(), third, other, plain, last];
    Arc::new(Problem::from(Task::new(roi, random_content(93, &roi), table, frames, true)))
}

/// Three sensors each, two of one rotation and one turned.
fn placements(count: usize) -> Vec<Placement> {
    let mut rng = rng(94);
    (0..count)
        .map(|index| {
            let lidars = (0..3).map(|k| {
                let [x, y, z] = [0; 3].map(|_| rng.random_range(-2.0..2.0));
                let [roll, pitch, yaw] = [0; 3].map(|_| rng.random_range(-0.4..0.4));
                let level = SensorPose { yaw: 0.5, ..SensorPose::at(x, y, z) };
                if k < 2 { level } else { SensorPose { roll, pitch, yaw, ..level } }
            });
            Placement { name: format!("{index}"), lidars: lidars.collect() }
        })
        .collect()
}

#[test]
fn overlapping_jobs_give_the_bits_of_the_cpu() {
    let problem = problem();
    let placements = placements(24);
    let want = cpu(&problem).tally(&placements, Some(RANGE as f32)).unwrap();
    assert!(want.iter().all(|tally| tally.hits > 0 && tally.hits < tally.beams));
    // Bytes of a sensor: its bitmap, the copy of that to the host, and its hits.
    let bitmap = 4 * problem.roi().voxel_count().div_ceil(32) as usize;
    let each = 2 * bitmap + 8 * problem.sensors().table(0).directions().len();
    // One chunk, and chunks of a few sensors.
    for memory in [MEMORY, 11 * each as u64] {
        let mut gpu = GpuBackend::new(problem.task().clone(), None, memory).unwrap();
        // The second batch finds the buffers of the first, the third needs larger ones.
        for count in [3, 2, 24] {
            let got = gpu.tally(&placements[..count], Some(RANGE as f32)).unwrap();
            assert_eq!(got, want[..count], "{memory} bytes");
        }
        let covered = gpu.covered(&placements[0], 2).unwrap();
        assert_eq!(covered, cpu(&problem).covered(&placements[0], 2).unwrap());
    }
}

/// Steps of which the kernel leaves no beam go to the device in one submission each, and the host waits once for each.
#[test]
fn a_step_is_one_submission_and_one_wait() {
    let whole = problem();
    let task = Arc::new(whole.over(&[1, 3]));
    let mut gpu = GpuBackend::new(task.task().clone(), None, MEMORY).unwrap();
    let opened = gpu.traffic();
    let (range, placements) = (Some(RANGE as f32), placements(24));
    assert_eq!(
        gpu.tally(&placements, range).unwrap(),
        cpu(&task).tally(&placements, range).unwrap()
    );
    let ran = gpu.traffic();
    assert_eq!((ran.submissions - opened.submissions, ran.waits - opened.waits), (2, 2));
    // Nothing but counters, sums and times comes back.
    let classes = task.content().set_count() as u64;
    let groups = (task.content().occupied().len() as u64).div_ceil(64 * 64);
    let words = 24 * (1 + classes + groups * 45) + 1 + 72 + 8;
    let down = ran.bytes_down - opened.bytes_down;
    assert!(down <= 2 * (4 * words + 4 * 8), "{down} bytes, {words} words");
}
