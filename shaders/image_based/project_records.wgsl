// Rays to coefficients of the light field. The light that arrives at a record through direction p is
// T_p L; its integral with spherical harmonic k over the pixel of p is T_p P_pk, where
// P_pk = integral of L Y_k over the pixel is exact and the same for all records. Lights with a direction
// of their own add T E Y_k(w_i). What records received of one another (receive_records.wgsl) is taken as
// the same all over the pixel.

// Column p, row k: P_pk in red, green and blue; integral of Y_k over the pixel in alpha.
@group(0) @binding(19) var products: texture_2d<f32>;
@group(0) @binding(20) var field: texture_storage_3d<rgba16float, write>;

// As receive_records.wgsl wrote it.
@group(0) @binding(21) var<storage, read> received: array<u32>;

// Whether records have received light from one another.
override EXCHANGED: bool = false;
// Whether the phase function towards the eye is folded in (the paper's form for media that change).
override DYNAMIC: bool = false;

// Largest number of the field's format.
const LARGEST = 65504.0;

@compute @workgroup_size(64)
fn project_records(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    let index = 64u * group.x + lane;
    let inside = index < steering(records.count);
    let entry = entries[records.first + min(index, records.count - 1u)];
    let coefficient = group.y;
    let cell = cell_of_record(entry.y);
    let x = position_of_record(cell);
    var w_o = records.eye.xyz;
    if records.eye.w != 0.0 { w_o = normalize(records.eye.xyz - x); }

    var sum = vec3f(0.0);
    for (var p = 0u; p < steering(records.directions); p++) {
        let product = textureLoad(products, vec2u(p, coefficient), 0);
        var found = rays[ray_slot(0u, p, entry.x)] * product.xyz;
        if GLOW { found += glow(p, entry.x) * product.w; }
        if EXCHANGED { found += from_records(p, entry.x) * product.w; }
        if DYNAMIC { found *= folded_phase(columns[p].xyz, w_o); }
        sum += found;
    }
    for (var i = 0u; i < steering(records.own_lights); i++) {
        let incident = incident_light(i, x);
        let transmittance = rays[ray_slot(0u, records.directions + i, entry.x)];
        var found = transmittance * incident.irradiance * (damping(coefficient) * spherical_harmonic(coefficient, incident.w_i));
        if DYNAMIC { found *= folded_phase(incident.w_i, w_o); }
        sum += found;
    }
    let left = (entry.y & LEFT) != 0u;
    if inside {
        let tile = vec3u(coefficient % records.bands, 0u, coefficient / records.bands) * vec3u(records.dims.x, 0u, records.dims.z);
        let texel = clamp(sum / records.scale, vec3f(-LARGEST), vec3f(LARGEST));
        textureStore(field, cell + tile, select(vec4f(texel, 1.0), vec4f(0.0), left));
        if coefficient == 0u {
            if !left && atomicLoad(&renewed[entry.x]) != 0u { add_to_record_counter(4u, 1u); }
            atomicStore(&renewed[entry.x], 0u);
        }
    }
}

fn glow(column: u32, slot: u32) -> vec3f {
    return vec3f(rays[ray_slot(1u, column, slot)], rays[ray_slot(2u, column, slot)], rays[ray_slot(3u, column, slot)]);
}

fn from_records(column: u32, slot: u32) -> vec3f {
    return records.scale * unpacked(received[column * records.capacity + slot]);
}

// 4 pi times the phase function: 1 where scattering is isotropic.
fn folded_phase(w_i: vec3f, w_o: vec3f) -> f32 {
    return phase_function(materials[records.material], -dot(w_i, w_o)) / INVERSE_4PI;
}

// Factor of the band of a coefficient: a von Hann window, if asked for.
fn damping(k: u32) -> f32 {
    let band = floor(sqrt(f32(k) + 0.5));
    return select(1.0, 0.5 + 0.5 * cos(PI * band / f32(records.bands)), records.window != 0u);
}
