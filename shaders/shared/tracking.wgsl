// Free flights and transmittances without bias: null-collision tracking below a bound for each
// macrocell (Woodcock et al. 1965; ratio tracking: Novak et al. 2014), leaping where there is no
// matter. A ray's way through a cell is a function of ray and cell alone, so that leaps change no
// bit of the picture. Where there is no matter around a tentative collision the ray goes on from the
// nearest place at which there can be: the bound of a cell that holds air and skin is no bound of air.

// The bits of a number: above 0 a bound of the extinction in the cell, below 0 there is no matter in
// cells closer than that; the bins that are relied on by reading it; and in two halves the values, of
// 65535 shares of the data's range, below and above which there is no matter in the cell.
@group(0) @binding(9) var macrocells: texture_3d<u32>;

const MACROCELL_EDGE = 4.0;
// The next cell is looked up this far (world units) behind the border, or less in thin volumes.
const BORDER_MARGIN = 1e-6;
// Below this a transmittance is continued at even odds, at twice its value.
const ROULETTE_BELOW = 0.1;
// Most random draws of one path.
const MOST_DRAWS = 16777216u;

// What became of a ray.
const UNFINISHED = 0u;
const COLLISION = 1u;
const ESCAPE = 2u;
const LOST = 3u;

// How far values may be off, as a share of the data's range: by f32 arithmetic, or by a sampler that
// knows 256 places between two voxels.
const SLACK_OF_NUMBERS = 1e-4;
const SLACK_OF_SAMPLER = 0.0078125;

// Bins the invocation's paths relied on.
var<private> bins_met: vec2u;
// Tentative collisions, cells looked up.
var<private> lookups: vec2u;

// Follows the path's ray; `steps`: cells and tentative collisions left to it.
fn track(path: ptr<function, Path>, pixel: vec2u, steps: ptr<function, u32>) -> u32 {
    let ray = Ray((*path).origin, (*path).direction);
    let shadow = (*path).stage == SHADOW;
    let end = (*path).end;
    // Along the ray everything is linear: cells, distances of their borders, and place in the volume.
    let to_cells = frame.voxels / (MACROCELL_EDGE * frame.size_world);
    let cell_origin = (ray.origin + 0.5 * frame.size_world) * to_cells;
    let cell_slope = ray.direction * to_cells;
    let tiny = select(vec3f(PARALLEL), vec3f(-PARALLEL), cell_slope < vec3f(0.0));
    let border_slope = 1.0 / select(cell_slope, tiny, abs(cell_slope) < vec3f(PARALLEL));
    let border_origin = -cell_origin * border_slope;
    let last_cell = vec3f(textureDimensions(macrocells)) - 1.0;
    let uvw_origin = ray.origin / frame.size_world + 0.5;
    let uvw_slope = ray.direction / frame.size_world;
    let thinnest = 1.0 / max(to_cells.x, max(to_cells.y, to_cells.z));
    let margin = min(BORDER_MARGIN, 1e-3 * thinnest);
    // Between two voxels a value changes by the data's range at most.
    let way_of_range = 1.0 / dot(abs(ray.direction), frame.voxels / frame.size_world);
    var t = (*path).t;
    var lookup = (*path).lookup;
    var optical_depth = (*path).optical_depth;
    var through = (*path).transmittance;
    var left = *steps;
    var outcome = select(ESCAPE, UNFINISHED, lookup < end);
    while outcome == UNFINISHED && left > 0u {
        // From cell to cell until a tentative collision lies in one.
        var found = false;
        var bound = 0.0;
        var free = 0u;
        var far = end;
        while !found && outcome == UNFINISHED && left > 0u {
            left -= 1u;
            lookups.y += 1u;
            let cell = clamp(floor(cell_origin + lookup * cell_slope), vec3f(0.0), last_cell);
            let known = textureLoad(macrocells, vec3i(cell), 0);
            bound = bitcast<f32>(known.x);
            bins_met |= known.yz;
            free = known.w;
            let reach = max(-bound, 1.0);
            let low = border_origin + (cell - (reach - 1.0)) * border_slope;
            let high = border_origin + (cell + reach) * border_slope;
            let enter = min(low, high);
            let leave = max(low, high);
            far = min(min(leave.x, leave.y), min(leave.z, end));
            if bound > 0.0 {
                t = max(t, max(max(enter.x, enter.y), enter.z));
                let there = t + optical_depth / bound;
                found = there < far;
                optical_depth = max(optical_depth - bound * max(far - t, 0.0), 0.0);
                t = select(max(t, far), there, found);
            }
            if !found {
                lookup = max(lookup, far);
                lookup += max(margin, 2.4e-7 * lookup);
                if lookup >= end { outcome = ESCAPE; }
            }
        }
        if found {
            lookups.x += 1u;
            let texel = texel_value(uvw_origin + t * uvw_slope);
            let s = s_of_texel(texel);
            let sigma_t = sigma_t_in(piece_of(s, found), s);
            let u = unit2(draw(path, pixel).xy);
            optical_depth = -log(u.x);
            if shadow {
                through *= max(1.0 - sigma_t / bound, 0.0);
                if through < ROULETTE_BELOW {
                    through = select(2.0 * through, 0.0, u.y < 0.5);
                    if through <= 0.0 { outcome = ESCAPE; }
                }
            } else if u.y * bound < sigma_t {
                (*path).s = s;
                outcome = COLLISION;
            }
            if FILTER != 2u && sigma_t <= 0.0 {
                // No farther than the cell that the limits are known of.
                t = clamp(t + value_to_matter(texel, free) * way_of_range, t, max(far, t));
            }
            if (*path).draws > MOST_DRAWS { outcome = LOST; }
        }
    }
    (*path).t = t;
    (*path).lookup = lookup;
    (*path).optical_depth = optical_depth;
    (*path).transmittance = through;
    *steps = left;
    return outcome;
}

// By how much the value must change, as a share of the data's range, until there can be matter.
fn value_to_matter(texel: f32, free: u32) -> f32 {
    let limits = unpack2x16unorm(free);
    let value = frame.value_scale * texel + frame.value_offset;
    return max(limits.x - value, value - limits.y) - select(SLACK_OF_SAMPLER, SLACK_OF_NUMBERS, FILTER == 1u);
}

// Four words of the path's sequence.
fn draw(path: ptr<function, Path>, pixel: vec2u) -> vec4u {
    let bits = pcg4d(vec4u(pixel, (*path).draws, seed()));
    (*path).draws += 1u;
    return bits;
}
