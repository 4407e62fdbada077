// Light of all sources that has not been scattered yet: transmittance times what each brings
// (README.md, equations 7 and 8).

@group(0) @binding(29) var<storage, read_write> transmittances: array<u32>;
@group(0) @binding(40) var<uniform> sources: Sources;

const MAX_FIELD_LIGHTS = 64u;

// Mirrored by `Sources` in server/render/src/uniforms.rs.
struct Sources {
    // Mean radiance from all around, in the field's unit.
    ambient: vec3f,
    count: u32,
    // 1 / the radiance that the field holds as 1: here and in all that follows, light is in this unit.
    inverse_scale: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
    // Through a face to each side of the axes (faces.wgsl), the fluence that would bring as much light from
    // all sides as comes from that one: four times the irradiance.
    outside: array<vec4f, 6>,
    // Of light i in `lights`: where its transmittances begin; four lights a vector.
    slots: array<vec4u, MAX_FIELD_LIGHTS / 4u>,
}

// Nearer to a light than this, world units, it is no stronger: the same for every grid.
const NEAREST = 0.02;

struct Direct {
    // Fluence at the cell's centre, and its mean over the cell.
    at_centre: vec3f,
    mean: vec3f,
}

fn direct_light(i: u32, cell: vec3u, index: u32) -> Direct {
    var x = (vec3f(cell) + 0.5 - 0.5 * vec3f(grid.cells)) * grid.cell_size;
    let kind = lights[i].kind;
    if kind == 1u || kind == 2u {
        let offset = x - lights[i].position;
        let distance = length(offset);
        if distance < NEAREST {
            x = lights[i].position + select(vec3f(0.0, 0.0, NEAREST), offset * (NEAREST / distance), distance > 1e-6);
        }
    }
    let incident = incident_light(i, x);
    let shares = transmittances_of(i, index);
    let arriving = incident.irradiance * sources.inverse_scale;
    return Direct(arriving * shares.x, arriving * shares.y);
}

// Of light i: at the cell's centre, and the mean over the cell.
fn transmittances_of(i: u32, index: u32) -> vec2f {
    return unpack2x16unorm(transmittances[sources.slots[i / 4u][i % 4u] + index]);
}
