//! Kernels as AMD's compiler makes them, without a device: Mesa's RADV compiles for a device that is not there.
//!
//! `cargo test --lib isa -- --nocapture` prints registers and spills of each kernel. `tests/run` installs its packages.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use wgpu::naga::back::spv;
use wgpu::naga::front::wgsl;
use wgpu::naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};
use wgpu::naga::{BinaryOperator, Expression, ShaderStage};

use super::kernels::{SOURCES, source};
use crate::maths::mixed;

/// One chip of each of four generations.
const FAMILIES: [&str; 4] = ["polaris10", "vega10", "navi21", "gfx1100"];
const DRIVERS: [&str; 2] =
    ["/usr/share/vulkan/icd.d/radeon_icd.x86_64.json", "/usr/share/vulkan/icd.d/radeon_icd.json"];

/// A kernel after compilation: statistics by name, and its instructions with their operands, word by word.
struct Compiled {
    statistics: BTreeMap<String, u64>,
    program: Vec<String>,
}

impl Compiled {
    /// Instructions whose name begins with one of the prefixes; a line may hold two.
    fn count(&self, prefixes: &[&str]) -> usize {
        let named = |word: &&String| prefixes.iter().any(|prefix| word.starts_with(prefix));
        self.program.iter().filter(named).count()
    }

    /// Floats multiplied and added in one instruction.
    fn fused(&self) -> usize {
        let (fma, mad) =
            (["v_fma", "v_pk_fma", "v_dual_fma", "v_dot"], ["v_mac", "v_mad_f", "v_mad_l"]);
        self.count(&fma) + self.count(&mad) + self.count(&["v_madak", "v_madmk", "v_mad_mix"])
    }

    /// Instructions with an error of an ulp or more.
    fn approximate(&self) -> usize {
        self.count(&["v_rcp", "v_rsq", "v_sqrt", "v_exp", "v_log", "v_sin", "v_cos", "v_div_"])
    }
}

/// Python with the package `vulkan`, and RADV; or the name of the missing part.
fn compiler() -> Result<(PathBuf, &'static str), String> {
    let driver = DRIVERS.into_iter().find(|file| Path::new(file).exists());
    let driver = driver.ok_or("Mesa's RADV is not installed")?;
    let own =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join("target/isa/venv/bin/python");
    let has_vulkan = |python: &PathBuf| {
        let output = Command::new(python).args(["-c", "import vulkan"]).output();
        output.is_ok_and(|output| output.status.success())
    };
    let python = [own, PathBuf::from("python3")].into_iter().find(has_vulkan);
    Ok((python.ok_or("Python has no package `vulkan`, which tests/run installs")?, driver))
}

/// A kernel as SPIR-V, with the options that wgpu takes for RADV.
fn spirv(kernel: &str, source: &str) -> Vec<u8> {
    let module =
        wgsl::parse_str(source).unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)));
    let info =
        Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).unwrap();
    let options = spv::Options {
        lang_version: (1, 5),
        flags: spv::WriterFlags::empty(),
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer: BoundsCheckPolicy::Unchecked,
            image_load: BoundsCheckPolicy::Unchecked,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        zero_initialize_workgroup_memory: match kernel {
            "cast_closest" => spv::ZeroInitializeWorkgroupMemoryMode::None,
            _ => spv::ZeroInitializeWorkgroupMemoryMode::Polyfill,
        },
        ..Default::default()
    };
    let entry =
        spv::PipelineOptions { shader_stage: ShaderStage::Compute, entry_point: kernel.to_owned() };
    let words = spv::write_vec(&module, &info, &options, Some(&entry)).unwrap();
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Kernels compiled for a chip; each has a name, its entry point, and perhaps a word behind a dot.
fn compiled(
    (python, driver): &(PathBuf, &str),
    family: &str,
    kernels: &[(String, String)],
) -> BTreeMap<String, Compiled> {
    let folder = tempfile::tempdir().unwrap();
    let files = kernels.iter().map(|(name, source)| {
        let file = folder.path().join(format!("{name}.spv"));
        fs::write(&file, spirv(name.split('.').next().unwrap(), source)).unwrap();
        file
    });
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join("tests/isa/compile.py");
    let output = Command::new(python)
        .arg(script)
        .args(files)
        .env("VK_DRIVER_FILES", driver)
        .env("VK_ICD_FILENAMES", driver)
        .env("RADV_FORCE_FAMILY", family)
        .env("RADV_DEBUG", "shaders,nocache")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{family}: {said}");
    let statistics: BTreeMap<String, BTreeMap<String, u64>> =
        serde_json::from_slice(&output.stdout).unwrap();
    let parts = said.split("KERNEL ").skip(1).map(|part| {
        let (name, rest) = part.split_once('\n').unwrap();
        let program = rest.rsplit_once("disasm:").expect("the driver prints programs").1;
        let code = program.lines().map(|line| line.split(';').next().unwrap_or_default());
        let program: Vec<String> =
            code.flat_map(str::split_whitespace).map(str::to_owned).collect();
        assert!(
            program.last().is_some_and(|word| word.starts_with("s_")),
            "{name}: a whole program"
        );
        (name.to_owned(), Compiled { statistics: statistics[name].clone(), program })
    });
    parts.collect()
}

/// The sources of all kernels that ship.
fn shipped() -> Vec<(String, String)> {
    let sources = SOURCES.iter().map(|(name, parts)| ((*name).to_owned(), source(parts)));
    sources.collect()
}

/// The sum of `planes` as it is, and with its products rounded.
const PLANES: (&str, &str) = (
    "return begin + vec4<f32>((vec4(bytes) >> vec4(0u, 8u, 16u, 24u)) & vec4(255u)) * step;",
    "let product = vec4<f32>((vec4(bytes) >> vec4(0u, 8u, 16u, 24u)) & vec4(255u)) * step;
    return rounded(begin) + bitcast<vec4<f32>>(bitcast<vec4<u32>>(product) ^ vec4(zero));",
);

fn replaced(source: &str, from: &str, to: &str) -> String {
    assert!(source.contains(from), "the kernels changed, and this test has to: no `{from}`");
    source.replace(from, to)
}

/// Prints a row of the table of kernels.
fn print(family: &str, name: &str, compiled: &Compiled) {
    let number = |name: &str| compiled.statistics.get(name).copied().unwrap_or_default();
    println!(
        "| {family} | `{name}` | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
        number("VGPRs"),
        number("Subgroups per SIMD"),
        number("Spilled VGPRs") + number("Spilled SGPRs"),
        number("Scratch size"),
        number("LDS size"),
        number("Instructions"),
        number("Inverse Throughput"),
        compiled.fused(),
        compiled.approximate(),
    );
}

/// Number of places in a kernel that divide floats, by the function they stand in.
fn quotients(source: &str) -> Vec<String> {
    let module = wgsl::parse_str(source).unwrap();
    let entries = module.entry_points.iter().map(|entry| &entry.function);
    let functions = module.functions.iter().map(|(_, function)| function).chain(entries);
    let quotients = functions.flat_map(|function| {
        let divides = |expression: &&Expression| {
            matches!(expression, Expression::Binary { op: BinaryOperator::Divide, .. })
        };
        let name = function.name.clone().unwrap_or_default();
        function.expressions.iter().map(|(_, e)| e).filter(divides).map(move |_| name.clone())
    });
    quotients.collect()
}

/// The compiler has no product to merge with a sum but the 24 of `planes` (four children, six sides), which decide nothing, and no
/// quotient but in `divide`, which corrects it. `self_test` shows how a device treats both.
#[test]
fn isa_leaves_the_compiler_no_choice() {
    let mut kernels = shipped();
    for (name, source) in kernels.iter().filter(|(name, _)| name != "self_test") {
        let elsewhere = quotients(source).into_iter().find(|function| function != "divide");
        assert_eq!(elsewhere, None, "{name}: a quotient outside `divide`");
    }
    let compiler = match compiler() {
        Ok(compiler) => compiler,
        Err(missing) => {
            assert!(std::env::var_os("EXPECT_ADAPTER").is_none(), "{missing}");
            return println!("instructions of AMD devices left out: {missing}");
        }
    };
    let cast = kernels[0].1.clone();
    let unfused = replaced(&cast, PLANES.0, PLANES.1);
    kernels.push(("cast_closest.unfused".into(), unfused));
    let plain = replaced(&cast, "^ vec3(zero)", "").replace("^ vec2(zero)", "");
    kernels.push(("cast_closest.plain".into(), plain));
    println!(
        "| chip | kernel | VGPRs | waves | spills | scratch | LDS | instructions | cost | fused | rcp |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for family in FAMILIES {
        let compiled = compiled(&compiler, family, &kernels);
        for (name, compiled) in &compiled {
            print(family, name, compiled);
        }
        for (name, fused, approximate) in [
            ("cast_closest", 24, 6),
            ("cast_closest.unfused", 0, 6),
            ("cover_voxels", 0, 3),
            ("reduce_words", 0, 0),
            ("reduce_occupied", 0, 0),
            ("reduce_classes", 0, 0),
        ] {
            let kernel = &compiled[name];
            assert_eq!(kernel.fused(), fused, "{name} on {family}: fused products");
            let other = kernel.approximate();
            assert!(other <= approximate, "{name} on {family}: {other} approximate instructions");
        }
        let plain = compiled["cast_closest.plain"].fused();
        assert!(
            plain > 24,
            "{family}: without `rounded` {plain} products are fused, and nothing is shown"
        );
        let cast = &compiled["cast_closest"].statistics;
        for slow in ["Spilled VGPRs", "Spilled SGPRs", "Scratch size"] {
            assert_eq!(cast[slow], 0, "{slow} of cast_closest on {family}");
        }
    }
}

/// a / b to the nearest float, ties to even, from a quotient of the mantissas that is `wrong` units in its last place
/// off, at most 2. Holds for a and b normal and |a / b| above 2^-126, and for a = 0.
fn divide(a: f32, b: f32, wrong: i32) -> f32 {
    let (bits_a, bits_b) = (a.to_bits(), b.to_bits());
    let (fraction_a, fraction_b) = (bits_a & 0x7f_ffff, bits_b & 0x7f_ffff);
    let (m_a, m_b) = (fraction_a | 0x80_0000, fraction_b | 0x80_0000);
    let less = m_a < m_b;
    let one = 1_f32.to_bits();
    let guess = f32::from_bits(fraction_a | one) / f32::from_bits(fraction_b | one);
    let guess = f32::from_bits(guess.to_bits().wrapping_add_signed(wrong));
    let q = (guess * if less { 16_777_216.0 } else { 8_388_608.0 }) as u32;
    let r = (m_a << (23 + u32::from(less))).wrapping_sub(q.wrapping_mul(m_b)).cast_signed();
    let m = m_b.cast_signed();
    let low = i32::from(r < 0) + i32::from(r < -m) + i32::from(r < -2 * m);
    let high = i32::from(r >= m) + i32::from(r >= 2 * m) + i32::from(r >= 3 * m);
    let whole = q.wrapping_add_signed(high - low);
    let twice = 2 * (r - (high - low) * m);
    let up = u32::from(twice > m || (twice == m && whole & 1 == 1));
    let exponent = (bits_a >> 23 & 255).wrapping_sub(bits_b >> 23 & 255);
    let exponent = exponent.wrapping_add(126 - u32::from(less));
    let bits = (exponent << 23).wrapping_add(whole + up) | (bits_a ^ bits_b) & 1 << 31;
    if bits_a << 1 == 0 { 0.0 } else { f32::from_bits(bits) }
}

/// Compares with the host's division for every error from −2 to 2; pairs out of range are left out. Returns the
/// quotients compared.
fn compare(a: f32, b: f32) -> u64 {
    let want = a / b;
    let in_range = a.is_normal() && want.is_finite() && want.abs() > f32::MIN_POSITIVE;
    if !b.is_normal() || !(in_range || a == 0.0) {
        return 0;
    }
    for wrong in -2..=2 {
        let got = divide(a, b, wrong);
        // Zeros may have either sign.
        assert!(got == want, "{a:e} / {b:e}, {wrong} ulp: {got:e} for {want:e}");
    }
    5
}

/// Powers of two and their neighbours, over all exponents and both signs.
#[test]
fn quotients_about_powers_of_two_are_correctly_rounded() {
    let near = |power: u32| {
        let around = [0, 1, 2, 3, 0x40_0000, 0x7f_fffd, 0x7f_fffe, 0x7f_ffff];
        around.map(|fraction| f32::from_bits(power << 23 | fraction))
    };
    let mut compared = 0;
    for a in (1..=254).flat_map(near) {
        for b in (1..=254).step_by(11).flat_map(near) {
            compared += compare(a, b) + compare(-a, b);
        }
    }
    assert!(compared > 2_000_000, "{compared}");
    assert_eq!(compare(0.0, 3.0) + compare(-0.0, -1e-9), 10);
}

/// A million pairs of any bits, or `SIGHTLINE_QUOTIENTS`; half of them have neighbouring mantissas.
#[test]
fn quotients_of_any_bits_are_correctly_rounded() {
    let count = std::env::var("SIGHTLINE_QUOTIENTS").ok();
    let count: u64 = count.map_or(1_000_000, |count| count.parse().expect("a number of pairs"));
    let mut compared = 0;
    for pair in 0..count {
        let bits = mixed(pair);
        let (a, mut b) = (bits as u32, (bits >> 32) as u32);
        if pair % 2 == 0 {
            b = b & 0xff80_0000 | a.wrapping_add(b % 7).wrapping_sub(3) & 0x7f_ffff;
        }
        compared += compare(f32::from_bits(a), f32::from_bits(b));
    }
    assert!(compared > 2 * count, "{compared}");
}
