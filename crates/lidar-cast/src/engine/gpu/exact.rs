//! Twin of `divide` in `shaders/common/exact.wgsl`: its steps, with a quotient that is as wrong as a device's.

use crate::maths::mixed;

/// a / b to the nearest float, ties to even, from the quotient of the mantissas with an error of `wrong` units in its
/// last place; for a and b normal and |a / b| above 2^-126, or a = 0, and errors of up to 2.
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
