// How much extinction there is around the texels of the field: what photons' interactions are compared
// with. Between eight texel centres extinction is added up with their trilinear weights, which are the
// shares of `deposit`: the quotient of the two is fluence, wherever matter begins and ends.

// Cells between texel centres, one more than texels along each axis: of each eight sums.
@group(0) @binding(14) var<storage, read_write> moments: array<f32>;
// Cells to be added up.
@group(0) @binding(15) var<storage, read> cells: array<u32>;
@group(0) @binding(13) var<uniform> mass: Mass;
@group(0) @binding(9) var macrocells: texture_3d<u32>;

struct Mass {
    // Texels of the field.
    dims: vec3u,
    // Cells to be added up.
    count: u32,
}

// Light that falls straight on opaque matter, seen from where it comes: half of it is left, on average
// over what is seen.
const MOST_DEPTH = 2.0;
// Optical depth of a texel from which on only its skin counts.
const OPAQUE_DEPTH = 6.0;
// Whether it does: for light that comes from one side only both skins of a wall would count, and one is lit.
override SKINS: bool = true;
// Places along an axis of a cell.
const PLACES = 4u;

@compute @workgroup_size(64)
fn add_up_mass(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    always_zero = id.z;
    let which = id.y * groups.x * 64u + id.x;
    let cell_index = cells[min(which, mass.count - 1u)];
    let across = mass.dims + 1u;
    let cell = vec3f(f32(cell_index % across.x), f32(cell_index / across.x % across.y), f32(cell_index / (across.x * across.y)));
    let dims = vec3f(mass.dims);
    var sums = array<f32, 8>();
    let step = frame.size_world / (dims * f32(PLACES));
    let volume = step.x * step.y * step.z;
    for (var i = 0u; i < PLACES * PLACES * PLACES; i++) {
        let part = (vec3f(f32(i % PLACES), f32(i / PLACES % PLACES), f32(i / (PLACES * PLACES))) + 0.5) / f32(PLACES);
        let uvw = (cell - 0.5 + part) / dims;
        let sigma_t = counted(uvw, step);
        if sigma_t > 0.0 {
            for (var corner = 0u; corner < 8u; corner++) {
                let upper = vec3u(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
                let near = select(1.0 - part, part, upper == vec3u(1u));
                sums[corner] += sigma_t * volume * (near.x * near.y * near.z);
            }
        }
    }
    if which < mass.count {
        for (var corner = 0u; corner < 8u; corner++) { moments[8u * cell_index + corner] = sums[corner]; }
    }
}

// Extinction at a place; cells at the border stick half out of the box.
fn extinction_at(uvw: vec3f) -> f32 {
    let last = vec3i(textureDimensions(macrocells)) - 1;
    let macrocell = clamp(vec3i(floor(uvw * frame.voxels / 4.0)), vec3i(0), last);
    let inside = all(uvw > vec3f(0.0)) && all(uvw < vec3f(1.0));
    if !inside || bitcast<f32>(textureLoad(macrocells, macrocell, 0).x) <= 0.0 { return 0.0; }
    if !keeps((uvw - 0.5) * frame.size_world) { return 0.0; }
    let s = s_of_texel(texel_value(uvw));
    return sigma_t_in(piece_of(s, true), s);
}

// Extinction at a place as far as light gets and is seen from outside: of matter that is opaque within a
// texel what lies no deeper than MOST_DEPTH below its skin, whatever part of texels it fills. `step`: between
// places of the sum.
fn counted(uvw: vec3f, step: vec3f) -> f32 {
    let sigma_t = extinction_at(uvw);
    let across = (step.x + step.y + step.z) / 3.0;
    let texel = across * f32(PLACES);
    let depth = sigma_t * texel;
    var seen = min(sigma_t, MOST_DEPTH / texel);
    if SKINS && depth > MOST_DEPTH {
        // Of the axes the one with the nearest way out within a texel; a thin wall has two skins on it.
        var nearest = MOST_DEPTH;
        var uncovered = 0.0;
        var before_last = 0.0;
        for (var way = 0u; way < 6u; way++) {
            let axis = vec3f(vec3u(way / 2u) == vec3u(0u, 1u, 2u));
            let onward = select(step, -step, (way & 1u) == 1u) * axis;
            var before = 0.0;
            for (var i = 1u; i <= PLACES; i++) {
                if before < MOST_DEPTH {
                    before += extinction_at(uvw + f32(i) * onward / frame.size_world) * dot(step, axis);
                }
            }
            before = min(before, MOST_DEPTH);
            if (way & 1u) == 1u && min(before, before_last) < nearest {
                nearest = min(before, before_last);
                uncovered = 2.0 * MOST_DEPTH - before - before_last;
            }
            before_last = before;
        }
        let skin = min(sigma_t, uncovered / across);
        seen = mix(seen, skin, smoothstep(MOST_DEPTH, OPAQUE_DEPTH, depth));
    }
    return seen;
}
