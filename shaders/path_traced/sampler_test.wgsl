// Test entry points: what the samplers choose, and the densities they state. Joined to the module of
// `path_trace` by server/render/src/sampler_tests.rs.

@group(0) @binding(18) var<storage, read_write> samples: array<vec4f>;
@group(0) @binding(19) var<storage, read> places: array<vec4f>;

const TEST_W_O = vec3f(0.36, 0.48, 0.8);
const TEST_N = vec3f(0.0, 0.0, 1.0);
const TEST_ALBEDO = vec3f(0.9, 0.6, 0.3);

fn test_scatterer() -> Scatterer {
    return scatterer(materials[0], TEST_ALBEDO, TEST_W_O, TEST_N);
}

@compute @workgroup_size(64)
fn sample_directions(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    let w_i = sample_direction(test_scatterer(), unit4(pcg4d(vec4u(id.x, 1u, 2u, 3u))));
    samples[id.x] = vec4f(w_i, 0.0);
}

@compute @workgroup_size(64)
fn direction_densities(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    samples[id.x] = vec4f(direction_density(test_scatterer(), places[id.x].xyz), 0.0, 0.0, 0.0);
}

@compute @workgroup_size(64)
fn sample_ways_on(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    let at = test_scatterer();
    let way = sample_way_on(at, unit4(pcg4d(vec4u(id.x, 7u, 8u, 9u))));
    samples[id.x] = vec4f(way, max_of(scattered_light(at, way)) / max(density_of_way_on(at, way), 1e-30));
}

@compute @workgroup_size(64)
fn way_on_densities(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    samples[id.x] = vec4f(density_of_way_on(test_scatterer(), places[id.x].xyz), 0.0, 0.0, 0.0);
}

@compute @workgroup_size(64)
fn sample_lights(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    let light = towards(0u, vec3f(0.1, -0.2, 0.05), pcg4d(vec4u(id.x, 4u, 5u, 6u)));
    samples[id.x] = vec4f(light.w_i, light.density);
}

@compute @workgroup_size(64)
fn light_densities(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    let ray = Ray(vec3f(0.1, -0.2, 0.05), places[id.x].xyz);
    let light = sources[0];
    var density = INVERSE_4PI;
    if light.kind == IMAGE { density = image_density(ray.direction); }
    if light.kind >= RECTANGLE && light.kind <= SPHERE { density = meet(light, ray).y; }
    samples[id.x] = vec4f(density, 0.0, 0.0, 0.0);
}

@compute @workgroup_size(64)
fn sample_lights_evenly(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    let light = towards_image_evenly(sources[0].power, unit4(sobol4(id.x, 7u)).xy);
    samples[id.x] = vec4f(light.w_i, light.density);
}

@compute @workgroup_size(64)
fn even_numbers(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    samples[id.x] = unit4(sobol4(id.x, 0x9e3779b9u));
}
