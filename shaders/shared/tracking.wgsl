// Free flights and transmittances without bias: null-collision tracking below a bound for each
// macrocell (Woodcock et al. 1965; ratio tracking: Novak et al. 2014), leaping where there is no
// matter. A ray's way through a cell is a function of ray and cell alone, so that leaps change no
// bit of the picture. Where there is no matter around a tentative collision the ray goes on from the
// nearest place at which there can be: the bound of a cell that holds air and skin is no bound of air.
// And where a cell is dense the value at a place, and how fast it can change, bound the extinction near it.

// The bits of a number: above 0 a bound of the extinction in the cell, below 0 there is no matter in cells
// closer than that; the bins that are relied on by reading it; and in one word the values, of 1023 shares of
// the data's range, below and above which there is no matter in the cell (10 bits each), and the upper bits,
// without sign, of how much extinction can change between two voxels in the cell (12 bits).
@group(0) @binding(9) var macrocells: texture_3d<u32>;

const MACROCELL_EDGE = 4.0;
// The next cell is looked up this far (world units) behind the border, or less in thin volumes.
const BORDER_MARGIN = 1e-6;
// Below this a transmittance is continued at even odds, at twice its value.
const ROULETTE_BELOW = 0.1;
// Optical depth, by its bound, from which on a cell is dense.
const DENSE = 16.0;
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

// And from where in voxels they seem to come, as extinction's growth has it.
const SLACK_OF_PLACE = 0.0125;

// Bins the invocation's paths relied on.
var<private> bins_met: vec2u;
// Tentative collisions, cells looked up.
var<private> lookups: vec2u;

// Follows the path's ray; `steps`: cells and tentative collisions left to it. Below 0 the path's optical
// depth says that a tentative collision is at `t`, and minus the bound that it was found below: all that
// goes on is kept in the path, so that it makes no difference where `steps` ends.
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
    // Voxels crossed along all three axes together, per world unit.
    let voxels_per_way = dot(abs(ray.direction), frame.voxels / frame.size_world);
    var t = (*path).t;
    var lookup = (*path).lookup;
    var optical_depth = (*path).optical_depth;
    var through = (*path).transmittance;
    var left = *steps;
    var outcome = select(ESCAPE, UNFINISHED, lookup < end);
    var cell = cell_at(cell_origin + lookup * cell_slope, last_cell);
    var far = min(last_border(cell, border_origin, border_slope), end);
    if cell.bound > 0.0 { t = max(t, first_border(cell, border_origin, border_slope)); }
    while outcome == UNFINISHED && left > 0u {
        // The value here: what becomes of a tentative collision, and how dense matter near it can be.
        let collides = optical_depth < 0.0;
        let looks = collides || is_dense(cell, voxels_per_way, far - t);
        let texel = texel_value(uvw_origin + t * uvw_slope);
        let s = s_of_texel(texel);
        let sigma_t = sigma_t_in(piece_of(s, looks), s);
        lookups.x += select(0u, 1u, looks);
        if collides {
            let bound = -optical_depth;
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
            if (*path).draws > MOST_DRAWS { outcome = LOST; }
        }
        if FILTER != 2u && looks && sigma_t <= 0.0 && outcome == UNFINISHED {
            // No farther than the cell that the limits are known of.
            t = clamp(t + value_to_matter(texel, cell.free) / voxels_per_way, t, max(far, t));
        }
        // Up to `near` extinction stays below `close`.
        let close = bound_near(sigma_t, cell.rise, voxels_per_way);
        let pays = looks && is_dense(cell, voxels_per_way, far - t) && close < 0.5 * cell.bound;
        let near = select(0.0, min(t + 1.0 / close, far), pays);
        // From cell to cell until a value is needed. The first is the one that was looked into.
        var found = false;
        var first = true;
        while !found && outcome == UNFINISHED && left > 0u {
            left -= 1u;
            lookups.y += 1u;
            cell = cell_at(cell_origin + lookup * cell_slope, last_cell);
            bins_met |= cell.bins;
            far = min(last_border(cell, border_origin, border_slope), end);
            if cell.bound > 0.0 {
                t = max(t, first_border(cell, border_origin, border_slope));
                let is_near = near > t;
                let bound = select(cell.bound, close, is_near);
                let stop = select(far, near, is_near);
                let there = t + optical_depth / bound;
                // What is dense is looked into before it is entered.
                let enters = !first && is_dense(cell, voxels_per_way, far - t);
                let hits = !enters && there < stop;
                if !enters {
                    optical_depth = select(max(optical_depth - bound * max(stop - t, 0.0), 0.0), -bound, hits);
                    t = select(max(t, stop), there, hits);
                }
                found = enters || hits || stop < far;
            }
            first = false;
            if !found {
                lookup = max(lookup, far);
                lookup += max(margin, 2.4e-7 * lookup);
                if lookup >= end { outcome = ESCAPE; }
            }
        }
    }
    (*path).t = t;
    (*path).lookup = lookup;
    (*path).optical_depth = optical_depth;
    (*path).transmittance = through;
    *steps = left;
    return outcome;
}

struct Macrocell {
    place: vec3f,
    bound: f32,
    // By how much extinction can change from voxel to voxel.
    rise: f32,
    bins: vec2u,
    free: u32,
}

fn cell_at(x: vec3f, last_cell: vec3f) -> Macrocell {
    let place = clamp(floor(x), vec3f(0.0), last_cell);
    let known = textureLoad(macrocells, vec3i(place), 0);
    return Macrocell(place, bitcast<f32>(known.x), bitcast<f32>(known.w >> 20u << 19u), known.yz, known.w);
}

// Where a ray enters and leaves a cell, and those closer than an empty cell's distance.
fn first_border(cell: Macrocell, origin: vec3f, slope: vec3f) -> f32 {
    let borders = min(origin + (cell.place - (reach_of_cell(cell) - 1.0)) * slope, origin + (cell.place + reach_of_cell(cell)) * slope);
    return max(max(borders.x, borders.y), borders.z);
}

fn last_border(cell: Macrocell, origin: vec3f, slope: vec3f) -> f32 {
    let borders = max(origin + (cell.place - (reach_of_cell(cell) - 1.0)) * slope, origin + (cell.place + reach_of_cell(cell)) * slope);
    return min(min(borders.x, borders.y), borders.z);
}

fn reach_of_cell(cell: Macrocell) -> f32 {
    return max(-cell.bound, 1.0);
}

// Whether a cell is so dense for this part of it that bounds of less than it pay, if air bounds them.
fn is_dense(cell: Macrocell, voxels_per_way: f32, way: f32) -> bool {
    return cell.bound * way > DENSE && bound_near(0.0, cell.rise, voxels_per_way) < 0.5 * cell.bound;
}

// Extinction stays below it as long as the optical depth by it stays below 1, from where it is `sigma_t` on.
fn bound_near(sigma_t: f32, rise: f32, voxels_per_way: f32) -> f32 {
    let least = sigma_t + rise * SLACK_OF_PLACE;
    return 1.0001 * 0.5 * (least + sqrt(least * least + 4.0 * rise * voxels_per_way));
}

// By how much the value must change, as a share of the data's range, until there can be matter.
fn value_to_matter(texel: f32, free: u32) -> f32 {
    let limits = vec2f(vec2u(free, free >> 10u) & vec2u(1023u)) / 1023.0;
    let value = frame.value_scale * texel + frame.value_offset;
    return max(limits.x - value, value - limits.y) - select(SLACK_OF_SAMPLER, SLACK_OF_NUMBERS, FILTER == 1u);
}

// Four words of the path's sequence.
fn draw(path: ptr<function, Path>, pixel: vec2u) -> vec4u {
    let bits = pcg4d(vec4u(pixel, (*path).draws, seed()));
    (*path).draws += 1u;
    return bits;
}
