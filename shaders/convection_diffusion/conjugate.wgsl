// Passes of the conjugate gradients, preconditioned by one V-cycle (README.md, equation 14). Each
// channel has its own step lengths.

const SUMS = 8u;
// r . z of the iteration before, p . A p, r . r, r . z, b . b.
const RZ_BEFORE = 0u;
const P_AP = 1u;
const RR = 2u;
const RZ = 3u;
const BB = 4u;

var<workgroup> partial: array<vec4f, 64>;

// Writes the sum over the workgroup as its partial sum.
fn add_up(value: vec4f, group: vec3u, lane: u32) {
    partial[lane] = value;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half >>= 1u) {
        if lane < half { partial[lane] += partial[lane + half]; }
        workgroupBarrier();
    }
    if lane == 0u { sums[SUMS + group.y * GROUP_ROW + group.x] = partial[0]; }
}

fn quotient(a: vec4f, b: vec4f) -> vec4f {
    return select(vec4f(0.0), a / max(b, vec4f(1e-37)), b > vec4f(1e-37));
}

// r = b - A x; sums up b . b.
@compute @workgroup_size(64)
fn begin_solve(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = index_in_level(group, lane);
    var b = vec4f(0.0);
    if index < level.count {
        let cell = cell_in(index, level.cells);
        let own = flows[index];
        let value = solution[index];
        b = residuals[index];
        var rest = b - losses[index] * value;
        for (var face = 0u; face < 6u; face++) {
            let other = neighbour(cell, index, face);
            if other.there { rest -= between(own, flows[other.index]) * other.weight * (value - solution[other.index]); }
        }
        residuals[index] = rest;
    }
    add_up(b * b, group, lane);
}

// A p; sums up p . A p.
@compute @workgroup_size(64)
fn apply_operator(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = index_in_level(group, lane);
    var product = vec4f(0.0);
    if index < level.count {
        let cell = cell_in(index, level.cells);
        let own = flows[index];
        let value = directions[index];
        var image = losses[index] * value;
        for (var face = 0u; face < 6u; face++) {
            let other = neighbour(cell, index, face);
            if other.there { image += between(own, flows[other.index]) * other.weight * (value - directions[other.index]); }
        }
        images[index] = image;
        product = value * image;
    }
    add_up(product, group, lane);
}

// x and r one step on; sums up r . r.
@compute @workgroup_size(64)
fn step_on(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = index_in_level(group, lane);
    var rest = vec4f(0.0);
    if index < level.count {
        let length = quotient(sums[RZ], sums[P_AP]);
        solution[index] += length * directions[index];
        rest = residuals[index] - length * images[index];
        residuals[index] = rest;
    }
    add_up(rest * rest, group, lane);
}

// Sums up r . z, or r . r.
override WITH_ITSELF: bool = false;
@compute @workgroup_size(64)
fn correlate(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = index_in_level(group, lane);
    var product = vec4f(0.0);
    if index < level.count {
        let rest = residuals[index];
        if WITH_ITSELF { product = rest * rest; } else { product = rest * corrections[index]; }
    }
    add_up(product, group, lane);
}

// The next search direction.
@compute @workgroup_size(64)
fn turn(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = index_in_level(group, lane);
    if index >= level.count { return; }
    let kept = quotient(sums[RZ], sums[RZ_BEFORE]);
    directions[index] = corrections[index] + kept * select(directions[index], vec4f(0.0), kept == vec4f(0.0));
}

// Adds the partial sums of the last pass up as one of the sums.
override SUM: u32 = 0u;
@compute @workgroup_size(64)
fn sum_up(@builtin(local_invocation_index) lane: u32) {
    let groups = (level.count + 63u) / 64u;
    var sum = vec4f(0.0);
    for (var i = lane; i < groups; i += 64u) { sum += sums[SUMS + i]; }
    partial[lane] = sum;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half >>= 1u) {
        if lane < half { partial[lane] += partial[lane + half]; }
        workgroupBarrier();
    }
    if lane == 0u {
        if SUM == RZ { sums[RZ_BEFORE] = sums[RZ]; }
        sums[SUM] = partial[0];
    }
}
