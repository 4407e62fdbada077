// A signed 64-bit number in two words, about.
fn whole_number(low: u32, high: u32) -> f32 {
    let is_negative = high >= 0x80000000u;
    // The magnitude, so that small negative numbers keep their digits.
    let borrow = select(0u, 1u, low != 0u);
    let magnitude_low = select(low, ~low + 1u, is_negative);
    let magnitude_high = select(high, ~high + 1u - borrow, is_negative);
    let magnitude = f32(magnitude_high) * 4294967296.0 + f32(magnitude_low);
    return select(magnitude, -magnitude, is_negative);
}
