// Parts of a ray's way through a cell, on which the field is taken as linear, and the pieces of the
// transfer function that they are split into.

// Parts of a cell bend by no more than this, in s; where there are normals, which turn within a part,
// by less;
const MOST_BEND = 0.002;
const MOST_BEND_OF_SURFACES = 0.0005;
// unless they were more than these.
const MOST_PARTS_BY_BEND = 8.0;

// Where shadows are looked up, parts are no deeper than this (optical depth);
const MOST_DEPTH_OF_A_PART = 0.5;
// unless they were more than these.
const MOST_PARTS_BY_DEPTH = 16.0;

// Keeps a quotient of extinctions finite.
const SMALLEST_EXTINCTION = 1e-30;

// Where along a part of given extinction at its ends and optical depth what is linear along it has
// its mean, weighted by the light that reaches the eye from there (0: near end, 1: far end). In
// thin matter the centre of extinction, in dense matter the skin.
fn centre_of_light(sigma_t: vec2f, optical_depth: f32) -> f32 {
    let near_share = sigma_t.x / max(sigma_t.x + sigma_t.y, SMALLEST_EXTINCTION);
    // Mean optical depth, by the light from there, as a share of the whole.
    let mean_depth = select(1.0 / optical_depth - 1.0 / (exp(optical_depth) - 1.0),
        0.5 - optical_depth / 12.0, optical_depth < 0.05);
    let thin = (2.0 - near_share) / 3.0 - share_at_depth(near_share, 0.5);
    return share_at_depth(near_share, mean_depth) + 2.0 * mean_depth * thin;
}

// Share of the length after which a share of the optical depth is reached, for extinction that is
// linear along it: the root of (1 - 2n) x^2 + 2n x = depth.
fn share_at_depth(near_share: f32, depth: f32) -> f32 {
    let root = sqrt(max(near_share * near_share + (1.0 - 2.0 * near_share) * depth, 0.0));
    return depth / max(near_share + root, 1e-10);
}

struct FieldPoint {
    t: f32,
    s: f32,
    extinction: TableEntry,
}

fn field_point(t: f32, s: f32) -> FieldPoint {
    return FieldPoint(t, s, table_entry(s));
}

// The first part of a step on which s, taken as linear along the step, stays within one piece of
// the transfer function: extinction, albedo and emission are linear there.
struct Part {
    end: FieldPoint,
    ends_step: bool,
    // Extinction at both ends, within the piece.
    sigma_t: vec2f,
    piece: i32,
}

fn first_part(near: FieldPoint, far: FieldPoint) -> Part {
    if one_piece(near.extinction, far.extinction) {
        return Part(far, true, vec2f(near.extinction.sigma_t, far.extinction.sigma_t), near.extinction.point);
    }
    let rising = far.s >= near.s;
    let piece = piece_from(near.s, rising, near.extinction.point);
    let border = select(piece_interval(piece).x, piece_interval(piece).y, rising);
    let ends_step = select(far.s >= border, far.s <= border, rising);
    var end = far;
    if !ends_step {
        end.s = border;
        end.t = mix(near.t, far.t, (border - near.s) / (far.s - near.s));
        // The entry is the far point's: no longer one piece with any, and the search starts there.
        end.extinction = TableEntry(0.0, piece, true);
    }
    return Part(end, ends_step, vec2f(sigma_t_in(piece, near.s), sigma_t_in(piece, end.s)), piece);
}
