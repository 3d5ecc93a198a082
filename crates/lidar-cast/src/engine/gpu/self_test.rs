//! Arithmetic self-test of a device: whether it keeps the bits that the kernels need, and which of Vulkan's freedoms
//! it uses.
//!
//! Only devices that answered the table of arithmetic are used.

use std::collections::HashMap;
use std::sync::Mutex;

use serde::Serialize;

use super::device::{AdapterSummary, Device, WORK, instance, ranked_adapters, summary};
use super::kernels::Kernels;
use super::layout::WORKGROUP_SIZE;
use crate::engine::{EngineChoice, Result};
use crate::maths::mixed;

/// Operations in the order of their numbers in `shaders/self_test.wgsl`.
const OPERATIONS: [&str; 18] = [
    "a + b", "a - b", "a * b", "divide(a, b)", "rounded(a * b) + c", "rounded(a + b) + c",
    "rounded(a - b) * c", "min(a, b)", "max(a, b)", "compare(a, b)", "floor(a)", "ceil(a)",
    "f32(a)", "u32(a)", "a * b + c", "(a + b) + c", "a / b", "a * b, denormal",
];
/// Kind of arithmetic of each operation that kernels depend on.
const KINDS_OF_ARITHMETIC: [&str; 14] = [
    "rounding of sums",
    "rounding of differences",
    "rounding of products, or denormals that the kernels keep off",
    "division",
    "fusion of a product and a sum",
    "fusion of sums",
    "fusion of a difference and a product",
    "least of two",
    "greatest of two",
    "comparison",
    "rounding down",
    "rounding up",
    "conversion to a float",
    "conversion to an integer",
];
const PRODUCT: usize = 2;
const COMPARE: usize = 9;
const TO_FLOAT: usize = 12;
const TO_WORD: usize = 13;
/// Operations from here on show freedoms and have no wrong answer.
const FREE: usize = 14;
const FUSED: usize = 14;
const REORDERED: usize = 15;
const QUOTIENT: usize = 16;
const DENORMAL: usize = 17;

const KEPT_FAILURES: usize = 8;

/// Coordinates, directions, limits and neighbours of powers of two, as kernels meet them.
const VALUES: [f32; 20] = [
    0.0, 1.0, -1.0, 0.999_999_94, 1.000_000_1, 3.0, -0.333_333_34, 0.1, -7.3, 1e-9, 1e9, 1e20,
    8_388_607.5, 16_777_215.0, 0.25, 31.75, -32_767.5, 1e-12, 8.673_617e-19, 1_099_511_627_776.0,
];

/// One case: the number of an operation and the bits of its operands.
type Case = (usize, [u32; 3]);

/// One wrong answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WrongAnswer {
    /// Operation on a, b and c, in WGSL.
    pub operation: &'static str,
    /// a, b and c.
    pub operands: [String; 3],
    /// Answer of the device.
    pub got: String,
    /// Answer of IEEE 754, to nearest even.
    pub expected: String,
}

/// A device's answers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelfTest {
    /// True if every answer that kernels depend on is right.
    pub passed: bool,
    /// Cases that kernels depend on.
    pub cases: usize,
    /// Wrong answers among them.
    pub wrong: usize,
    /// The first wrong answers.
    pub examples: Vec<WrongAnswer>,
    /// Arithmetic that the device gets wrong, a sentence for each kind.
    pub causes: Vec<String>,
    /// True if it fuses a·b + c into one rounding.
    pub fuses: bool,
    /// True if it reorders sums.
    pub reorders: bool,
    /// True if its native division is correctly rounded.
    pub divides_exactly: bool,
    /// True if it flushes denormal products to zero.
    pub flushes_denormals: bool,
}

impl SelfTest {
    /// Outcome, product beside sum, division and denormals, a word each.
    pub fn words(&self) -> [&'static str; 4] {
        [
            if self.passed { "passed" } else { "failed" },
            match (self.fuses, self.reorders) {
                (false, false) => "as written",
                (true, false) => "fused",
                (false, true) => "reordered",
                (true, true) => "fused, reordered",
            },
            if self.divides_exactly { "exact" } else { "inexact" },
            if self.flushes_denormals { "flushed" } else { "kept" },
        ]
    }

    /// The first wrong answer in words; none where the device passed.
    fn complaint(&self) -> Option<String> {
        let WrongAnswer { operation, operands: [a, b, c], got, expected } =
            self.examples.first()?;
        Some(format!(
            "{} of {} answers of its self-test are wrong, the first: {operation} with a = {a}, b = {b}, c = {c} gave \
             {got}, expected {expected}",
            self.wrong, self.cases
        ))
    }
}

/// A case that asks for nothing.
const NO_CASE: Case = (OPERATIONS.len(), [0; 3]);

/// The table of all cases.
fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let float = |index: usize| VALUES[index % VALUES.len()].to_bits();
    for first in 0..VALUES.len() {
        for second in 0..VALUES.len() {
            let pair = [float(first), float(second), 0];
            cases
                .extend([0, 1, 2, 3, 7, 8, 9, 10, 11, QUOTIENT].map(|operation| (operation, pair)));
            for third in 0..VALUES.len() {
                let three = [float(first), float(second), float(third)];
                cases.extend([4, 5, 6, FUSED, REORDERED].map(|operation| (operation, three)));
            }
        }
    }
    for number in 0..8192 {
        let bits = mixed(number);
        // Exponents of 2^-31 to 2^-16 and of 2 to 2^16, any fraction.
        let near_one = |word: u32| {
            word & 0x87ff_ffff | if word & 1 << 27 == 0 { 0x4000_0000 } else { 0x3000_0000 }
        };
        let [a, b] = [bits as u32, (bits >> 32) as u32].map(near_one);
        // Added to the product it leaves 0, or the part that a merged sum does not round away.
        let minus = (-(f32::from_bits(a) * f32::from_bits(b))).to_bits();
        cases.extend([3, QUOTIENT].map(|operation| (operation, [a, b, 0])));
        cases.extend([0, 1, PRODUCT].map(|operation| (operation, [a, b, 0])));
        cases.extend([4, FUSED].map(|operation| (operation, [a, b, minus])));
        cases.push((TO_FLOAT, [bits as u32 & 0xff_ffff, 0, 0]));
        cases.push((TO_WORD, [((bits & 0x1ff_ffff) as f32 / 2.0).to_bits(), 0, 0]));
    }
    for power in 1..24 {
        let half = f32::from_bits((127 - 64) << 23 | power);
        cases.push((
            DENORMAL,
            [half.to_bits(), f32::from_bits((127 - 64 - power) << 23).to_bits(), 0],
        ));
    }
    cases.retain(|(operation, words)| in_range(*operation, *words));
    cases
}

/// True if the results of a case are zero or normal, as in the kernels; operations without an arm always pass.
fn in_range(operation: usize, words: [u32; 3]) -> bool {
    let [a, b, c] = words.map(f32::from_bits);
    let fits = |x: f32| x == 0.0 || x.is_normal();
    match operation {
        3 | QUOTIENT => {
            b != 0.0 && (a == 0.0 || (a / b).is_normal() && (a / b).abs() > f32::MIN_POSITIVE)
        }
        4 | FUSED => fits(a * b) && fits(a * b + c),
        5 | REORDERED => fits(a + b) && fits(a + b + c),
        6 => fits(a - b) && fits((a - b) * c),
        PRODUCT => fits(a * b),
        _ => true,
    }
}

/// The answer of the host.
fn expected(operation: usize, words: [u32; 3]) -> u32 {
    let [a, b, c] = words.map(f32::from_bits);
    let float = match operation {
        0 => a + b,
        1 => a - b,
        PRODUCT | DENORMAL => a * b,
        3 | QUOTIENT => a / b,
        4 | FUSED => a * b + c,
        5 | REORDERED => a + b + c,
        6 => (a - b) * c,
        7 => a.min(b),
        8 => a.max(b),
        COMPARE => return if a < b { 1 } else { 10 + 4 * u32::from(a == b) },
        10 => a.floor(),
        11 => a.ceil(),
        TO_FLOAT => words[0] as f32,
        _ => return a as u32,
    };
    float.to_bits()
}

/// True if an answer has the expected bits; +0 equals −0, since no kernel tells them apart.
fn right(operation: usize, got: u32, want: u32) -> bool {
    let zeros = operation != COMPARE && operation != TO_WORD && got << 1 == 0 && want << 1 == 0;
    got == want || zeros
}

/// Judges a device's answers.
fn judge(cases: &[Case], answers: &[u32]) -> SelfTest {
    let judged = cases.iter().zip(answers);
    let misses = |operation: usize| {
        let mut own = judged.clone().filter(|((own, _), _)| *own == operation);
        own.any(|((_, words), &got)| !right(operation, got, expected(operation, *words)))
    };
    let wrong: Vec<_> = judged
        .clone()
        .filter(|((operation, words), got)| {
            *operation < FREE && !right(*operation, **got, expected(*operation, *words))
        })
        .collect();
    let count = |operation: usize| wrong.iter().filter(|(case, _)| case.0 == operation).count();
    let asked = |operation: usize| cases.iter().filter(|case| case.0 == operation).count();
    let causes = (0..FREE).filter(|&operation| count(operation) > 0).map(|operation| {
        let (kind, name) = (KINDS_OF_ARITHMETIC[operation], OPERATIONS[operation]);
        format!("{kind}: {} of {} answers to {name} are wrong", count(operation), asked(operation))
    });
    SelfTest {
        causes: causes.collect(),
        passed: wrong.is_empty() && answers.len() >= cases.len(),
        cases: cases.iter().filter(|case| case.0 < FREE).count(),
        wrong: wrong.len(),
        examples: wrong
            .iter()
            .take(KEPT_FAILURES)
            .map(|(case, got)| example(case, **got))
            .collect(),
        fuses: misses(FUSED),
        reorders: misses(REORDERED),
        divides_exactly: !misses(QUOTIENT),
        flushes_denormals: misses(DENORMAL),
    }
}

fn example(&(operation, words): &Case, got: u32) -> WrongAnswer {
    let float = |bits: u32| format!("{:e} (0x{bits:08x})", f32::from_bits(bits));
    let word = |bits: u32| bits.to_string();
    let answer =
        |bits| if operation == COMPARE || operation == TO_WORD { word(bits) } else { float(bits) };
    let operand = |bits| if operation == TO_FLOAT { word(bits) } else { float(bits) };
    WrongAnswer {
        operation: OPERATIONS[operation],
        operands: words.map(operand),
        got: answer(got),
        expected: answer(expected(operation, words)),
    }
}

/// A device, and how it computes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TestedAdapter {
    /// Device facts from its driver. `auto` stays true only if the self-test passed.
    #[serde(flatten)]
    pub summary: AdapterSummary,
    /// Its answers to a table of arithmetic; none where it could not be asked.
    pub self_test: Option<SelfTest>,
    /// Why it is not used, if it is not.
    pub refused: Option<String>,
}

/// Every Vulkan device of this machine, best first, each opened and asked to compute a table of arithmetic.
pub fn test_adapters() -> Vec<TestedAdapter> {
    let ranked = ranked_adapters(&instance());
    let tested = ranked.iter().enumerate().map(|(index, adapter)| {
        let mut summary = summary(index, adapter);
        let (self_test, refused) = match Device::of(adapter).and_then(|device| self_test(&device)) {
            Ok(result) => {
                let complaint = result.complaint();
                (Some(result), complaint)
            }
            Err(error) => (None, Some(error.to_string())),
        };
        summary.auto &= refused.is_none();
        TestedAdapter { summary, self_test, refused }
    });
    tested.collect()
}

/// Opens a device.
///
/// # Errors
/// No such device, or one that does not keep the bits that the kernels need, unless that is allowed.
pub(super) fn open(choice: &EngineChoice) -> Result<Device> {
    let device = Device::open(choice.adapter.as_deref())?;
    let result = self_test(&device)?;
    judged(device, &result, choice.inexact)
}

/// A device whose answers are right, or one that is marked as inexact where that is allowed.
fn judged(mut device: Device, result: &SelfTest, inexact: bool) -> Result<Device> {
    match result.complaint() {
        None => Ok(device),
        Some(_) if inexact => {
            device.adapter += ", inexact: it fails its self-test";
            Ok(device)
        }
        Some(complaint) => Err(device.failed("being opened", complaint)),
    }
}

fn run(device: &Device) -> Result<SelfTest> {
    let cases = cases();
    let count = cases.len().next_multiple_of(WORKGROUP_SIZE as usize);
    let padded = cases.iter().chain(std::iter::repeat(&NO_CASE)).take(count);
    let words: Vec<[u32; 5]> =
        padded.map(|&(operation, [a, b, c])| [operation as u32, a, b, c, 0]).collect();
    let kernels = Kernels::new();
    kernels.compile(device, |kernel| kernel == "self_test");
    device.check("compiling its self-test")?;
    let table = device.upload("cases", &words)?;
    let answers = device.buffer("answers", 4 * count as u64, WORK)?;
    // An answer that is never written is no right one.
    device.write(&answers, &vec![u32::MAX; count]);
    let record = |encoder: &mut wgpu::CommandEncoder| {
        let groups = [count as u32 / WORKGROUP_SIZE, 1, 1];
        kernels.dispatch(device, encoder, "self_test", &[&table, &answers], groups, None);
    };
    let reading = device.start("its self-test", record, &[(&answers, 4 * count as u64)])?;
    device.finish(reading, |parts| judge(&cases, bytemuck::cast_slice(parts[0])))
}

/// Results by device name and driver: a device is asked once in the life of the program.
static KNOWN: Mutex<Option<HashMap<String, SelfTest>>> = Mutex::new(None);

/// The device's answers.
///
/// # Errors
/// A device that fails to compile or run the table.
pub(super) fn self_test(device: &Device) -> Result<SelfTest> {
    let name = device.adapter.clone();
    let known = |known: &Option<HashMap<String, SelfTest>>| known.as_ref()?.get(&name).cloned();
    if let Some(result) = KNOWN.lock().ok().and_then(|table| known(&table)) {
        return Ok(result);
    }
    let result = run(device)?;
    if let Ok(mut table) = KNOWN.lock() {
        table.get_or_insert_default().insert(name, result.clone());
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_of_the_host_pass_and_planted_ones_are_named() {
        let cases = cases();
        let mut answers: Vec<u32> = cases.iter().map(|&(op, words)| expected(op, words)).collect();
        let right = judge(&cases, &answers);
        assert!(right.passed && right.divides_exactly && !right.fuses && !right.flushes_denormals);
        assert!(right.complaint().is_none() && right.cases > 10_000);
        // One wrong bit of each operation is found, or shows as a freedom.
        for (operation, name) in OPERATIONS.into_iter().enumerate() {
            let at = cases
                .iter()
                .position(|case| case.0 == operation && expected(operation, case.1) << 1 != 0);
            let at = at.unwrap_or_else(|| panic!("no case of {}", name));
            answers[at] ^= 1;
            let judged = judge(&cases, &answers);
            assert_eq!(judged.passed, operation >= FREE, "{}", name);
            assert_ne!(judged, right, "{}", name);
            let complaint = judged.complaint().unwrap_or_default();
            assert_eq!(complaint.contains(name), operation < FREE, "{complaint}");
            answers[at] ^= 1;
        }
    }

    /// Left out where there is no device.
    #[test]
    fn a_device_that_fails_is_refused_or_says_so_in_its_name() {
        let cases = cases();
        let mut answers: Vec<u32> = cases.iter().map(|&(op, words)| expected(op, words)).collect();
        let quotient = cases.iter().position(|case| case.0 == 3 && expected(3, case.1) != 0);
        answers[quotient.unwrap()] ^= 1;
        let wrong = judge(&cases, &answers);
        assert_eq!(wrong.causes.len(), 1);
        assert!(wrong.causes[0].starts_with("division: 1 of "), "{:?}", wrong.causes);
        let Ok(device) = Device::open(None) else { return };
        let name = device.adapter.clone();
        let refused = judged(device, &wrong, false).map(|_| ()).unwrap_err().to_string();
        assert!(refused.contains("divide(a, b)"), "{refused}");
        let taken = judged(Device::open(None).unwrap(), &wrong, true).unwrap();
        assert_eq!(taken.adapter, format!("{name}, inexact: it fails its self-test"));
    }

    #[test]
    fn a_device_that_fuses_shows_it() {
        let cases = cases();
        let fused = |&(op, words): &Case| {
            let [a, b, c] = words.map(f32::from_bits);
            if op == FUSED { a.mul_add(b, c).to_bits() } else { expected(op, words) }
        };
        let answers: Vec<u32> = cases.iter().map(fused).collect();
        let judged = judge(&cases, &answers);
        assert!(judged.passed && judged.fuses && !judged.reorders);
    }
}
