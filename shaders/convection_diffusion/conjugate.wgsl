// Passes of the conjugate gradients, preconditioned by one V-cycle (README.md, equation 14). Each
// channel has its own step lengths.

const SUMS = 8u;
// r . z of the iteration before, p . A p, r . r, r . z, b . b.
const RZ_BEFORE = 0u;
const P_AP = 1u;
const RR = 2u;
const RZ = 3u;
const BB = 4u;

// Cells that one invocation of these passes goes over; SHARE in diffusion.rs. It adds up what it finds
// on its own: barriers are what a software device is slowest at.
const SHARE = 64u;

var<workgroup> partial: array<vec4f, 64>;

// Invocations of a pass that goes over shares.
fn invocations() -> u32 {
    return (level.count + SHARE - 1u) / SHARE;
}

fn quotient(a: vec4f, b: vec4f) -> vec4f {
    return select(vec4f(0.0), a / max(b, vec4f(1e-37)), b > vec4f(1e-37));
}

// r = b - A x; sums up b . b.
@compute @workgroup_size(64)
fn begin_solve(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = index_in_level(group, lane);
    let step = invocations();
    var sum = vec4f(0.0);
    if place >= step { return; }
    for (var index = place; index < level.count; index += step) {
        let near = around(cell_in(index, level.cells), index);
        let flow = flows_around(flows[index], near);
        let others = flow.x0 * solution[near.xs.x] + flow.x1 * solution[near.xs.y] + flow.y0 * solution[near.ys.x]
            + flow.y1 * solution[near.ys.y] + flow.z0 * solution[near.zs.x] + flow.z1 * solution[near.zs.y];
        let b = residuals[index];
        residuals[index] = b - (losses[index] + sum_of(flow)) * solution[index] + others;
        sum += b * b;
    }
    sums[SUMS + place] = sum;
}

// A p; sums up p . A p.
@compute @workgroup_size(64)
fn apply_operator(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = index_in_level(group, lane);
    let step = invocations();
    var sum = vec4f(0.0);
    if place >= step { return; }
    for (var index = place; index < level.count; index += step) {
        let near = around(cell_in(index, level.cells), index);
        let flow = flows_around(flows[index], near);
        let others = flow.x0 * directions[near.xs.x] + flow.x1 * directions[near.xs.y] + flow.y0 * directions[near.ys.x]
            + flow.y1 * directions[near.ys.y] + flow.z0 * directions[near.zs.x] + flow.z1 * directions[near.zs.y];
        let value = directions[index];
        let image = (losses[index] + sum_of(flow)) * value - others;
        images[index] = image;
        sum += value * image;
    }
    sums[SUMS + place] = sum;
}

// x and r one step on; sums up r . r.
@compute @workgroup_size(64)
fn step_on(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = index_in_level(group, lane);
    let step = invocations();
    var sum = vec4f(0.0);
    if place >= step { return; }
    let length = quotient(sums[RZ], sums[P_AP]);
    for (var index = place; index < level.count; index += step) {
        solution[index] += length * directions[index];
        let rest = residuals[index] - length * images[index];
        residuals[index] = rest;
        sum += rest * rest;
    }
    sums[SUMS + place] = sum;
}

// Sums up r . z, or r . r.
override WITH_ITSELF: bool = false;
@compute @workgroup_size(64)
fn correlate(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = index_in_level(group, lane);
    let step = invocations();
    var sum = vec4f(0.0);
    if place >= step { return; }
    for (var index = place; index < level.count; index += step) {
        let rest = residuals[index];
        if WITH_ITSELF { sum += rest * rest; } else { sum += rest * corrections[index]; }
    }
    sums[SUMS + place] = sum;
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
    let partials = invocations();
    var sum = vec4f(0.0);
    for (var i = lane; i < partials; i += 64u) { sum += sums[SUMS + i]; }
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
