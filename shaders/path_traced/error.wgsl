// How well a picture is known: sums over pixels of the variance of the mean and of the squared mean.
// One partial sum a workgroup; the host adds them.

@group(0) @binding(0) var<uniform> pixel_count: vec4u;
@group(0) @binding(1) var<storage, read> film: array<vec4f>;
@group(0) @binding(2) var<storage, read> spreads: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> sums: array<vec2f>;

var<workgroup> group_sums: array<vec2f, 256>;

@compute @workgroup_size(256)
fn error(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group.y * groups.x + group.x;
    let index = block * 256u + lane;
    var mine = vec2f(0.0);
    if index < pixel_count.x {
        let mean = film[index].xyz;
        let spread = spreads[index];
        let variance = spread.xyz / max(spread.w * (spread.w - 1.0), 1.0);
        mine = vec2f(dot(variance, vec3f(1.0)), dot(mean, mean));
    }
    group_sums[lane] = mine;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if lane < half { group_sums[lane] += group_sums[lane + half]; }
        workgroupBarrier();
    }
    if lane == 0u && block * 256u < pixel_count.x { sums[block] = group_sums[0]; }
}
