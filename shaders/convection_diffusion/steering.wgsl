// Always 0; the entry point sets it from an id that is 0 by the size of the dispatch. For passes
// that read no `frame`; see shaders/shared/frame.wgsl.
var<private> always_zero: u32;

// Uniform values that steer control flow pass through here.
fn steering(value: u32) -> u32 {
    return value + always_zero;
}
