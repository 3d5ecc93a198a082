//! Sums of prices: exact for decimals as files write them, whatever their order.

/// Most digits after the point that sums are exact for.
const DIGITS: i32 = 9;
/// Whole numbers up to here are exact in an `f64`.
const EXACT: f64 = (1_u64 << 53) as f64;
/// Share of a budget that a sum may lie above it by rounding.
const ROUNDING: f64 = 1e-12;

/// Sum of prices: the number nearest to the sum of the decimals that the prices were written as, with up to 9 digits
/// after the point. The order does not matter: three times 1.1 is 3.3. Other numbers are summed as they are.
pub fn sum_of_prices(prices: impl IntoIterator<Item = f64>) -> f64 {
    let prices: Vec<f64> = prices.into_iter().collect();
    if let [price] = prices[..] {
        return price;
    }
    let exact = (0..=DIGITS).find_map(|digits| sum_in(&prices, 10.0_f64.powi(digits)));
    exact.unwrap_or_else(|| prices.iter().sum())
}

/// Sum of prices that are all whole numbers of a unit, `1 / parts`; `None` where one is not, or the sum is too large.
fn sum_in(prices: &[f64], parts: f64) -> Option<f64> {
    let mut sum = 0.0;
    for price in prices {
        let whole = (price * parts).round();
        // Division rounds to the nearest number, as reading a decimal does.
        if whole / parts != *price {
            return None;
        }
        sum += whole;
    }
    (sum.abs() < EXACT).then_some(sum / parts)
}

/// True if a price is within a budget, but for rounding.
pub fn is_within_budget(price: f64, budget: f64) -> bool {
    price <= budget * (1.0 + ROUNDING)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prices_add_up_as_their_decimals_do_in_any_order() {
        assert_ne!(1.1 + 1.1 + 1.1, 3.3);
        assert_eq!(sum_of_prices([1.1; 3]), 3.3);
        assert_eq!(sum_of_prices([0.1, 0.2]), 0.3);
        // 1000.1 + 2000.3 + 0.4, forwards and backwards, and with cents of large sums.
        assert_eq!(sum_of_prices([1000.1, 2000.3, 0.4]), 3000.8);
        assert_eq!(sum_of_prices([0.4, 2000.3, 1000.1]), 3000.8);
        assert_eq!(sum_of_prices([123_456_789_012.34, 0.01]), 123_456_789_012.35);
        assert_eq!(sum_of_prices([0.000_000_001; 3]), 0.000_000_003);
        // Nothing, one, and numbers that are no such decimals.
        assert_eq!(sum_of_prices([]), 0.0);
        assert_eq!(sum_of_prices([0.123_456_789_012_345]), 0.123_456_789_012_345);
        assert_eq!(sum_of_prices([1e300, 1e300]), 2e300);
        assert_eq!(sum_of_prices([1.0 / 3.0, 1.0]), 1.0 / 3.0 + 1.0);
    }

    #[test]
    fn every_sum_of_cents_is_the_decimal_that_whole_cents_give() {
        let mut cents = 1_u64;
        for count in 1..=16_usize {
            let each: Vec<u64> = (0..count)
                .map(|_| {
                    cents = cents.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    cents >> 44
                })
                .collect();
            let price = |cents: u64| format!("{}.{:02}", cents / 100, cents % 100);
            let prices = each.iter().map(|&c| price(c).parse::<f64>().unwrap());
            let wanted: f64 = price(each.iter().sum()).parse().unwrap();
            assert_eq!(sum_of_prices(prices), wanted, "{each:?}");
        }
    }

    #[test]
    fn a_budget_holds_its_own_sum_and_not_a_cent_more() {
        assert!(is_within_budget(3.300_000_000_000_000_3, 3.3) && is_within_budget(0.0, 0.0));
        assert!(is_within_budget(1e9, f64::INFINITY));
        assert!(!is_within_budget(100_000_000.01, 100_000_000.0) && !is_within_budget(1e-9, 0.0));
    }
}
