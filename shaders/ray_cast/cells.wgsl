// A view ray from cell to cell of the field.
//
// Between eight neighbouring voxel centres the trilinear field is a polynomial, and along a ray a
// cubic one: s(u) = c0 + c1 u + c2 u^2 + c3 u^3, u = 0..1 along the ray's way through the cell. So a
// ray is led through the cells one by one, and what it meets in a cell is known exactly from eight
// voxels. (Nearest filter: a cell is a voxel, and its value is constant.)
//
// Cells and the ray are mirrored so that the ray runs towards larger indices along every axis.

// The volume again, four voxels to a texel: texel (x, y, z) holds those at (x - 1, y - 1), (x, y - 1),
// (x - 1, y), (x, y) of layer z, the outermost ones extended.
@group(0) @binding(12) var quads: texture_3d<f32>;
// Whether there is room for it; else voxels are read one by one.
override QUADS: bool = false;

// In voxels, mirrored: cell c spans c .. c + 1.
struct Grid {
    origin: vec3f,
    // Voxels per world unit of the ray; above 0.
    direction: vec3f,
    inverse: vec3f,
    // 1, or -1 where the axis is mirrored.
    side: vec3f,
}

fn grid_of(ray: Ray) -> Grid {
    let side = select(vec3f(1.0), vec3f(-1.0), ray.direction < vec3f(0.0));
    let voxels_per_world = frame.voxels / frame.size_world;
    let direction = max(abs(ray.direction), vec3f(PARALLEL)) * voxels_per_world;
    // Corners of cells are voxel centres; with the nearest filter the voxels themselves are cells.
    let corner = select(0.5, 0.0, FILTER == 2u);
    let origin = (ray.origin + 0.5 * frame.size_world) * voxels_per_world - corner;
    return Grid(side * origin, direction, 1.0 / direction, side);
}

fn cell_at(grid: Grid, t: f32) -> vec3f {
    return floor(grid.origin + t * grid.direction);
}

// Distance at which the ray enters a cell. From the cell's index alone, not from the way there, so
// that it is the same however the ray has come.
fn enters_at(grid: Grid, cell: vec3f) -> f32 {
    let t = (cell - grid.origin) * grid.inverse;
    return max(max(t.x, t.y), t.z);
}

// Distances at which it would leave the cell through its three far faces.
fn leaves_at(grid: Grid, cell: vec3f) -> vec3f {
    return (cell + 1.0 - grid.origin) * grid.inverse;
}

fn smallest(v: vec3f) -> f32 {
    return min(min(v.x, v.y), v.z);
}

// One axis, that of the smallest component.
fn axis_of_smallest(v: vec3f) -> vec3f {
    let x = v.x <= v.y && v.x <= v.z;
    let y = !x && v.y <= v.z;
    return select(vec3f(0.0), vec3f(1.0), vec3<bool>(x, y, !x && !y));
}

// Cells that the ray meets between two distances.
fn cells_between(grid: Grid, from_t: f32, to_t: f32) -> f32 {
    return dot(cell_at(grid, to_t) - cell_at(grid, from_t), vec3f(1.0)) + 1.0;
}

// Texel values at the corners of a cell: of its near x face in the order (y, z) = 00, 10, 01, 11,
// and of its far one.
struct Corners {
    near: vec4f,
    far: vec4f,
}

fn corners_of(grid: Grid, cell: vec3f) -> Corners {
    let low = voxel_at(grid, cell);
    let high = voxel_at(grid, cell + 1.0);
    if QUADS {
        let mirrored = grid.side < vec3f(0.0);
        let quad = vec2i(clamp(select(cell.xy + 1.0, -cell.xy, mirrored.xy), vec2f(0.0), frame.voxels.xy));
        let front = as_the_ray_counts(textureLoad(quads, vec3i(quad, low.z), 0), mirrored);
        let back = as_the_ray_counts(textureLoad(quads, vec3i(quad, high.z), 0), mirrored);
        return Corners(vec4f(front.xz, back.xz), vec4f(front.yw, back.yw));
    }
    return Corners(
        vec4f(texel(low), texel(vec3i(low.x, high.y, low.z)), texel(vec3i(low.xy, high.z)), texel(vec3i(low.x, high.yz))),
        vec4f(texel(vec3i(high.x, low.yz)), texel(vec3i(high.xy, low.z)), texel(vec3i(high.x, low.y, high.z)), texel(high)),
    );
}

// Four values in the order (x, y) = 00, 10, 01, 11, along mirrored axes.
fn as_the_ray_counts(quad: vec4f, mirrored: vec3<bool>) -> vec4f {
    let by_x = select(quad, quad.yxwz, mirrored.x);
    return select(by_x, by_x.zwxy, mirrored.y);
}

fn voxel_at(grid: Grid, corner: vec3f) -> vec3i {
    return vec3i(clamp(grid.side * corner, vec3f(0.0), frame.voxels - 1.0));
}

fn texel(voxel: vec3i) -> f32 {
    return textureLoad(volume, voxel, 0).x;
}

// The voxel that a cell is, with the nearest filter.
fn voxel_of(grid: Grid, cell: vec3f) -> f32 {
    return texel(voxel_at(grid, cell + select(vec3f(0.0), vec3f(1.0), grid.side < vec3f(0.0))));
}

// Coefficients of the field between two distances within a cell, as s before it is clamped.
fn cubic_along(grid: Grid, cell: vec3f, corners: Corners, from_t: f32, to_t: f32) -> vec4f {
    let p = clamp(grid.origin + from_t * grid.direction - cell, vec3f(0.0), vec3f(1.0));
    let q = clamp(grid.origin + to_t * grid.direction - cell, vec3f(0.0), vec3f(1.0));
    let d = q - p;
    let n = corners.near;
    let f = corners.far;
    // v = n.x + x X + y Y + z Z + xy XY + xz XZ + yz YZ + xyz XYZ
    let x = f.x - n.x;
    let y = n.y - n.x;
    let z = n.z - n.x;
    let xy = (f.y - f.x) - y;
    let xz = (f.z - f.x) - z;
    let yz = (n.w - n.y) - z;
    let xyz = ((f.w - f.y) - (f.z - f.x)) - yz;
    let c0 = mix(mix(mix(n.x, f.x, p.x), mix(n.y, f.y, p.x), p.y), mix(mix(n.z, f.z, p.x), mix(n.w, f.w, p.x), p.y), p.z);
    let slope = vec3f(
        x + xy * p.y + (xz + xyz * p.y) * p.z,
        y + xy * p.x + (yz + xyz * p.x) * p.z,
        z + xz * p.x + (yz + xyz * p.x) * p.y,
    );
    let c1 = dot(slope, d);
    let c2 = xy * d.x * d.y + xz * d.x * d.z + yz * d.y * d.z
        + xyz * (p.x * d.y * d.z + p.y * d.x * d.z + p.z * d.x * d.y);
    let c3 = xyz * d.x * d.y * d.z;
    return frame.s_scale * vec4f(c0, c1, c2, c3) + vec4f(frame.s_offset, 0.0, 0.0, 0.0);
}

fn s_on(cubic: vec4f, u: f32) -> f32 {
    return clamp(cubic.x + u * (cubic.y + u * (cubic.z + u * cubic.w)), 0.0, 1.0);
}

// Largest distance of s, along a cell, from a straight line.
fn bend_of(cubic: vec4f) -> f32 {
    return 0.25 * abs(cubic.z) + 0.385 * abs(cubic.w);
}

// Up to where the ray, from t on, meets blocks without matter only; t if there may be some.
fn empty_until(grid: Grid, t: f32) -> f32 {
    if steering(frame.skip_empty) == 0u { return t; }
    return clear_until(distance_map, grid, t);
}

// Up to where the ray, from t on, meets no marked cell of a map; t if it is in one.
fn clear_until(map: texture_3d<u32>, grid: Grid, t: f32) -> f32 {
    let shift = select(0.5, 0.0, FILTER == 2u);
    let voxel = grid.side * (grid.origin + t * grid.direction) + shift;
    let last = frame.voxels - 1.0;
    let block = floor(clamp(voxel, vec3f(0.0), last) / MACROCELL_EDGE);
    let distance = f32(textureLoad(map, vec3i(block), 0).x);
    if distance == 0.0 { return t; }
    // The far border of the blocks closer than that.
    let border = MACROCELL_EDGE * (block + select(1.0 - vec3f(distance), vec3f(distance), grid.side > vec3f(0.0)));
    let leave = smallest((grid.side * (border - shift) - grid.origin) * grid.inverse);
    // Where a leap ends just before a border, the next one begins just behind it.
    return max(leave - LEAP_MARGIN_WORLD, t + LEAP_MARGIN_WORLD);
}
