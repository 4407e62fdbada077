// Scattering at a place: its value (1 - w) phase + w f_r |n . w_i|, a direction chosen after it,
// and the density of that choice. Formulas: README.md.

struct Scatterer {
    material: Material,
    albedo: vec3f,
    // Towards the eye.
    w_o: vec3f,
    // Unit, on the side of w_o; 0 where there is no surface.
    n: vec3f,
    // Weight of the surface.
    surface: f32,
}

fn scatterer(material: Material, albedo: vec3f, w_o: vec3f, n: vec3f) -> Scatterer {
    return Scatterer(material, albedo, w_o, n, select(0.0, material.surface, dot(n, n) > 0.0));
}

// Unit normal of the field on the side of w_o; 0 where the field is flat: a change of s by a
// millionth per voxel is rounding noise.
fn normal_at(x: vec3f, w_o: vec3f) -> vec3f {
    let gradient = gradient_at(x / frame.size_world + 0.5);
    let steepness = length(gradient);
    let voxel = frame.size_world / frame.voxels;
    if steepness * min(voxel.x, min(voxel.y, voxel.z)) < 1e-6 { return vec3f(0.0); }
    let n = gradient / steepness;
    return select(n, -n, dot(n, w_o) < 0.0);
}

// Radiance scattered per unit of extinction, of irradiance from w_i.
fn scattered(at: Scatterer, w_i: vec3f) -> vec3f {
    var value = (1.0 - at.surface) * phase_between(at.material, w_i, at.w_o) * at.albedo;
    if SURFACES {
        if at.surface > 0.0 {
            let f_r = brdf(at.material, at.n, w_i, at.w_o);
            value += at.surface * max(dot(at.n, w_i), 0.0) * (f_r.x * at.albedo + f_r.y);
        }
    }
    return value;
}

// Density per steradian with which `sample_direction` chooses w_i.
fn direction_density(at: Scatterer, w_i: vec3f) -> f32 {
    var density = (1.0 - at.surface) * phase_between(at.material, w_i, at.w_o);
    if SURFACES {
        if at.surface > 0.0 { density += at.surface * surface_density(at, w_i); }
    }
    return density;
}

// A direction towards light; 0 where nothing comes of the choice. `u`: which part, which lobe, and
// where in it.
fn sample_direction(at: Scatterer, u: vec4f) -> vec3f {
    var w_i = sample_phase(at.material, -at.w_o, u.zw);
    if SURFACES {
        if u.x < at.surface { w_i = sample_surface(at, u.y, u.zw); }
    }
    return w_i;
}

// Scattering per unit of extinction of light that arrives from `at.w_o`, towards `way`: the cosine is
// that of the light's side.
fn scattered_light(at: Scatterer, way: vec3f) -> vec3f {
    var value = (1.0 - at.surface) * phase_between(at.material, at.w_o, way) * at.albedo;
    if SURFACES {
        if at.surface > 0.0 && dot(at.n, way) > 0.0 {
            let f_r = brdf(at.material, at.n, at.w_o, way);
            value += at.surface * max(dot(at.n, at.w_o), 0.0) * (f_r.x * at.albedo + f_r.y);
        }
    }
    return value;
}

// Density per steradian with which `sample_way_on` chooses a way.
fn density_of_way_on(at: Scatterer, way: vec3f) -> f32 {
    var density = (1.0 - at.surface) * phase_between(at.material, at.w_o, way);
    if SURFACES {
        if at.surface > 0.0 {
            let share = specular_share(at);
            let all_ways = select(0.0, 1.0 / (2.0 * PI), dot(at.n, way) > 0.0);
            density += at.surface * ((1.0 - share) * all_ways + share * lobe_density(at, way));
        }
    }
    return density;
}

// A direction that light goes on in, as `sample_direction` chooses one that it comes from. With one
// difference: the cosine is that of the side it came from, so that a diffuse surface sends as much along
// itself as away from it. Ways chosen by their cosine would have weights of 1 / cosine, whose variance is
// infinite.
fn sample_way_on(at: Scatterer, u: vec4f) -> vec3f {
    if SURFACES {
        let is_diffuse = u.x < at.surface && u.y >= specular_share(at);
        if is_diffuse { return around(at.n, u.z, 2.0 * PI * u.w); }
    }
    return sample_direction(at, u);
}

// A direction of the phase function around the way light travels on undeflected: as light goes
// from w_i to w_o, or followed from the eye, the angle is the same. The versine (1 - cosine) is
// computed without a difference of nearly equal numbers, for narrow lobes.
fn sample_phase(material: Material, ahead: vec3f, u: vec2f) -> vec3f {
    var versine = 2.0 * u.x;
    var axis = ahead;
    if HENYEY_GREENSTEIN || SCHLICK {
        // Backward lobes are forward ones turned round.
        let g = abs(material.asymmetry);
        let spread = 1.0 - g + 2.0 * g * (1.0 - u.x);
        if material.phase != 0u && material.asymmetry < 0.0 { axis = -ahead; }
        if HENYEY_GREENSTEIN {
            if material.phase == 1u {
                versine = (1.0 - g) * (1.0 - g) * u.x / spread * ((1.0 + g) / spread + 1.0);
            }
        }
        if SCHLICK {
            if material.phase == 2u { versine = 2.0 * (1.0 - g) * u.x / spread; }
        }
    }
    return around(axis, versine, 2.0 * PI * u.y);
}

// The unit vector at 1 - cos(theta) = versine from the unit vector `axis`.
fn around(axis: vec3f, versine: f32, azimuth: f32) -> vec3f {
    let tangent = tangent_of(axis);
    let across = cos(azimuth) * tangent + sin(azimuth) * cross(axis, tangent);
    let sine = sqrt(max(versine * (2.0 - versine), 0.0));
    return normalize(sine * across + (1.0 - versine) * axis);
}

// Share of a surface's directions that are chosen from its specular lobe.
fn specular_share(at: Scatterer) -> f32 {
    let fade = select(1.0, 1.0 - at.material.specular, at.material.brdf == 2u);
    let brightest = max(at.albedo.x, max(at.albedo.y, at.albedo.z));
    let diffuse = at.material.diffuse * fade * brightest;
    let specular = min(at.material.lobe_reflectance, 1.0);
    if specular <= 0.0 { return 0.0; }
    if diffuse <= 0.0 { return 1.0; }
    return clamp(specular / (diffuse + specular), 0.1, 0.9);
}

fn surface_density(at: Scatterer, w_i: vec3f) -> f32 {
    let share = specular_share(at);
    return (1.0 - share) * max(dot(at.n, w_i), 0.0) / PI + share * lobe_density(at, w_i);
}

// Density per steradian of a direction from the specular lobe.
fn lobe_density(at: Scatterer, w_i: vec3f) -> f32 {
    let sum = w_i + at.w_o;
    let h = sum / max(length(sum), 1e-12);
    if dot(at.n, h) <= 0.0 { return 0.0; }
    return half_vector_density(at, h) / (4.0 * max(dot(h, at.w_o), 1e-6));
}

// Density per steradian of half vectors.
fn half_vector_density(at: Scatterer, h: vec3f) -> f32 {
    let n_h = clamp(dot(at.n, h), 0.0, 1.0);
    let lobe = at.material.lobe;
    if BLINN_PHONG {
        if at.material.brdf == 1u { return (lobe.x + 1.0) / (2.0 * PI) * pow(n_h, lobe.x); }
    }
    if ASHIKHMIN_SHIRLEY {
        if at.material.brdf == 2u {
            let tangent = tangent_of(at.n);
            let h_u = dot(h, tangent);
            let h_v = dot(h, cross(at.n, tangent));
            let across = max(h_u * h_u + h_v * h_v, 1e-12);
            let exponent = (lobe.x * h_u * h_u + lobe.y * h_v * h_v) / across;
            return sqrt((lobe.x + 1.0) * (lobe.y + 1.0)) / (2.0 * PI) * pow(n_h, exponent);
        }
    }
    if ABC {
        if at.material.brdf == 3u {
            return pow(1.0 + lobe.x * (1.0 - n_h), -lobe.y) / (2.0 * PI * at.material.lobe_mass);
        }
    }
    return 0.0;
}

fn sample_surface(at: Scatterer, choice: f32, u: vec2f) -> vec3f {
    let n = at.n;
    if choice >= specular_share(at) {
        // Cosine-weighted: uniform on the disk below.
        let tangent = tangent_of(n);
        let azimuth = 2.0 * PI * u.y;
        let across = cos(azimuth) * tangent + sin(azimuth) * cross(n, tangent);
        return normalize(sqrt(u.x) * across + sqrt(1.0 - u.x) * n);
    }
    let lobe = at.material.lobe;
    var versine = 0.0;
    var azimuth = 2.0 * PI * u.y;
    if BLINN_PHONG {
        if at.material.brdf == 1u { versine = one_minus_power(1.0 - u.x, 1.0 / (lobe.x + 1.0)); }
    }
    if ASHIKHMIN_SHIRLEY {
        if at.material.brdf == 2u {
            // A quarter turn at a time, the tangent of the azimuth being scaled.
            let quarter = min(floor(4.0 * u.y), 3.0);
            let odd = u32(quarter) % 2u == 1u;
            let within = 4.0 * u.y - quarter;
            let mirrored = select(within, 1.0 - within, odd);
            let angle = atan(sqrt((lobe.x + 1.0) / (lobe.y + 1.0)) * tan(0.5 * PI * mirrored));
            azimuth = 0.5 * PI * quarter + select(angle, 0.5 * PI - angle, odd);
            let c = cos(azimuth);
            let exponent = lobe.x * c * c + lobe.y * (1.0 - c * c);
            versine = one_minus_power(1.0 - u.x, 1.0 / (exponent + 1.0));
        }
    }
    if ABC {
        if at.material.brdf == 3u { versine = clamp(abc_inverse(lobe.x, lobe.y, u.x), 0.0, 1.0); }
    }
    let h = around(n, versine, azimuth);
    let h_o = dot(h, at.w_o);
    if h_o <= 0.0 { return vec3f(0.0); }
    return normalize(2.0 * h_o * h - at.w_o);
}

// 1 - x^p for x in 0..1, not as a difference where that is small.
fn one_minus_power(x: f32, p: f32) -> f32 {
    return -exp_minus_one(p * log(x));
}

// The y at which the integral of (1 + b y)^-c reaches the share u of its value at 1.
fn abc_inverse(b: f32, c: f32, u: f32) -> f32 {
    if b < 1e-6 { return u; }
    let log_b = log_one_plus(b);
    let whole = (1.0 - c) * log_b;
    var log_y = u * log_b;
    if abs(whole) > 1e-4 { log_y = log_one_plus(u * exp_minus_one(whole)) / (1.0 - c); }
    return exp_minus_one(log_y) / b;
}

fn exp_minus_one(x: f32) -> f32 {
    let series = x * (1.0 + 0.5 * x * (1.0 + x / 3.0 * (1.0 + 0.25 * x)));
    return select(exp(x) - 1.0, series, abs(x) < 0.03);
}

fn log_one_plus(x: f32) -> f32 {
    let series = x * (1.0 - x * (0.5 - x * (1.0 / 3.0 - x * 0.25)));
    return select(log(1.0 + x), series, abs(x) < 0.02);
}
