// Light layers: what each light, what lies behind the volume and glowing matter bring, each as if its
// colour were white and its strength 1, so that `mix_lights` can sum them up in any colours. What a
// path under way has found is kept aside and joins the layers when the path is at its end.

override LIGHT_LAYERS: bool = false;

// Of the pixels at work, layer by layer: means over the paths of even and of odd number, RGB each.
@group(0) @binding(16) var<storage, read_write> layers: array<f32>;
// Of the paths under way, layer by layer: RGB found so far.
@group(0) @binding(17) var<storage, read_write> findings: array<f32>;

// The path's place among those under way.
var<private> slot: u32;

// Behind the lights' layers.
fn layer_behind() -> u32 {
    return path_tracer.source_count;
}

fn layer_of_glow() -> u32 {
    return path_tracer.source_count + 1u;
}

fn layer_count() -> u32 {
    return steering(path_tracer.source_count) + 2u;
}

// Where a layer holds the path's pixel.
fn place_in_layer(layer: u32) -> u32 {
    return layer * frame.row_count * frame.image.x + slot;
}

// Light that the path found. Added even if there is none: a branch here, behind a look-up of the
// environment image, crashes the compiler of Mesa 22's software device.
fn find(path: ptr<function, Path>, layer: u32, radiance: vec3f) {
    if LIGHT_LAYERS {
        let at = 3u * place_in_layer(layer);
        findings[at] += radiance.x;
        findings[at + 1u] += radiance.y;
        findings[at + 2u] += radiance.z;
    } else {
        (*path).radiance += radiance;
    }
}

fn found_in(layer: u32) -> vec3f {
    let at = 3u * place_in_layer(layer);
    return vec3f(findings[at], findings[at + 1u], findings[at + 2u]);
}

// A path begins, if `begins`. Loops make no trip where no lane takes part: see `path_trace`.
fn forget_findings(begins: bool) {
    let count = select(0u, layer_count(), begins);
    for (var layer = 0u; layer < count; layer++) {
        let at = 3u * place_in_layer(layer);
        findings[at] = 0.0;
        findings[at + 1u] = 0.0;
        findings[at + 2u] = 0.0;
    }
}

// A path ends, if `ends`: the sum of what it found joins, if it is finite, the mean of the paths of
// even or odd number, of which there are `before` paths in all. Whether it was finite.
fn keep_findings(ends: bool, before: u32) -> bool {
    let count = select(0u, layer_count(), ends);
    var all = 0.0;
    for (var layer = 0u; layer < count; layer++) {
        all += dot(found_in(layer), vec3f(1.0));
    }
    let finite = all < 1e30;
    let odd = before % 2u;
    let share = 1.0 / f32(before / 2u + 1u);
    for (var layer = 0u; layer < count; layer++) {
        let radiance = select(vec3f(0.0), found_in(layer), finite);
        let at = 6u * place_in_layer(layer) + 3u * odd;
        // What the first path of its kind meets is another picture's.
        let held = select(vec3f(layers[at], layers[at + 1u], layers[at + 2u]), vec3f(0.0), before < 2u);
        let mean = held + share * (radiance - held);
        layers[at] = mean.x;
        layers[at + 1u] = mean.y;
        layers[at + 2u] = mean.z;
    }
    return finite;
}
