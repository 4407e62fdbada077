// Whole numbers of 64 bits in two words, the low one first. Each carry is counted, so the order makes no
// difference. The module says where a word is: `add_to_word` adds to it at once, and tells what it was.

fn add(first: u32, amount: i32) {
    let low = bitcast<u32>(amount);
    let before = add_to_word(first, low);
    let carry = select(0u, 1u, before + low < before);
    let high = select(0u, 0xffffffffu, amount < 0) + carry;
    if high != 0u { _ = add_to_word(first + 1u, high); }
}
