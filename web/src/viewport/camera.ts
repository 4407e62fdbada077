/**
 * The view: orbit, pan, zoom and the projection, on plain cameras.
 *
 * View axes: x to the right, y up, z towards the viewer (right-handed).
 */

import type { Camera } from "../generated/proto";
import { add, clamp, cross, dot, length, normalize, rotate, rounded, scale, sub, type Triple } from "../scene/vec";

/** Vertical angle of view where a camera leaves it open, degrees. */
export const DEFAULT_FOV_DEGREES = 40;
/** Nearest and farthest eye from its pivot, world units (the volume's longest edge is 1). */
const DISTANCE_RANGE: [number, number] = [0.02, 50];
/** Orbiting stops this close to straight up and down, radians. */
const POLE_MARGIN = 1e-3;

export interface Frame {
  right: Triple;
  up: Triple;
  /** From the target towards the eye. */
  back: Triple;
  /** Eye to target, world units. */
  distance: number;
}

/** The camera's axes in the world. */
export function frameOf(camera: Camera): Frame {
  const offset = sub(camera.position, camera.target);
  const back = normalize(offset);
  const right = normalize(cross(camera.up, back), perpendicular(back));
  return { right, up: cross(back, right), back, distance: length(offset) };
}

function perpendicular(a: Triple): Triple {
  return normalize(cross(Math.abs(a[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0], a));
}

/** World units that the viewport is high at the pivot. */
export function heightAtPivot(camera: Camera): number {
  if (camera.orthographic_height !== undefined) return camera.orthographic_height;
  const fov = camera.fov_y_degrees ?? DEFAULT_FOV_DEGREES;
  return 2 * frameOf(camera).distance * Math.tan((fov * Math.PI) / 360);
}

/** The world axis nearest to a direction: the axis a turntable turns about. */
export function nearestAxis(direction: Triple): Triple {
  const sizes = direction.map(Math.abs);
  const axis = sizes.indexOf(Math.max(...sizes));
  const result: Triple = [0, 0, 0];
  result[axis] = (direction[axis] ?? 0) < 0 ? -1 : 1;
  return result;
}

/**
 * Turntable about `pole` through the pivot. `yaw` turns the scene with the pointer to the right,
 * `pitch` with the pointer downwards; radians. The view never tips over the pole.
 */
export function orbit(camera: Camera, yaw: number, pitch: number, pole: Triple): Camera {
  const { right, up, back, distance } = frameOf(camera);
  // The eye moves against the pointer: the scene seems to be held.
  const fromPole = Math.acos(clamp(dot(back, pole), -1, 1));
  const upright = dot(up, pole) >= 0 ? 1 : -1;
  const tilt = clamp(fromPole - upright * pitch, POLE_MARGIN, Math.PI - POLE_MARGIN) - fromPole;
  const turn = (a: Triple) => rotate(rotate(a, right, upright * tilt), pole, -upright * yaw);
  return {
    ...camera,
    position: add(camera.target, scale(turn(back), distance)),
    up: normalize(turn(up)),
  };
}

/** Moves eye and pivot so that what lies at the pivot's depth follows the pointer, in viewport heights. */
export function pan(camera: Camera, dx: number, dy: number): Camera {
  const { right, up } = frameOf(camera);
  const height = heightAtPivot(camera);
  return shift(camera, add(scale(right, -dx * height), scale(up, dy * height)));
}

/**
 * Scales the picture about the pointer: `factor` < 1 comes nearer. `x`, `y` give the pointer from
 * the viewport's centre in viewport heights, y upwards; what lies there at the pivot's depth stays.
 */
export function zoom(camera: Camera, factor: number, x: number, y: number): Camera {
  const { right, up, back, distance } = frameOf(camera);
  const height = heightAtPivot(camera);
  const held = add(scale(right, x * height), scale(up, y * height));
  if (camera.orthographic_height !== undefined) {
    const next = clamp(camera.orthographic_height * factor, ...DISTANCE_RANGE);
    const k = next / camera.orthographic_height;
    return { ...shift(camera, scale(held, 1 - k)), orthographic_height: next };
  }
  const next = clamp(distance * factor, ...DISTANCE_RANGE);
  const target = add(camera.target, scale(held, 1 - next / distance));
  return { ...camera, target, position: add(target, scale(back, next)) };
}

/** Moves the pivot to `target` without turning the view. */
export const recentre = (camera: Camera, target: Triple): Camera => shift(camera, sub(target, camera.target));

/**
 * The view for a viewport of this shape (width / height). The angle of view is vertical: a narrow
 * viewport sees less to the sides, so the eye goes back until it sees all that a square one would.
 */
export function forAspect(camera: Camera, aspect: number): Camera {
  if (!(aspect > 0 && aspect < 1)) return camera;
  if (camera.orthographic_height !== undefined) return { ...camera, orthographic_height: camera.orthographic_height / aspect };
  const { back, distance } = frameOf(camera);
  return { ...camera, position: add(camera.target, scale(back, distance / aspect)) };
}

function shift(camera: Camera, by: Triple): Camera {
  return { ...camera, position: add(camera.position, by), target: add(camera.target, by) };
}

/** Looks at the pivot from direction `from`, at the same distance. */
export function lookFrom(camera: Camera, from: Triple, up: Triple): Camera {
  const { distance } = frameOf(camera);
  return { ...camera, position: add(camera.target, scale(normalize(from), distance)), up };
}

/** Same size at the pivot, without perspective. */
export function toOrthographic(camera: Camera): Camera {
  const { position, target, up } = camera;
  return { position, target, up, orthographic_height: rounded(heightAtPivot(camera)) };
}

/** Same size at the pivot, with perspective. */
export function toPerspective(camera: Camera, fovDegrees = DEFAULT_FOV_DEGREES): Camera {
  const height = heightAtPivot(camera);
  const { back } = frameOf(camera);
  const distance = height / (2 * Math.tan((fovDegrees * Math.PI) / 360));
  const { target, up } = camera;
  return { position: add(target, scale(back, distance)), target, up, fov_y_degrees: fovDegrees };
}

/** A world direction in view axes. */
export function toView(camera: Camera, direction: Triple): Triple {
  const { right, up, back } = frameOf(camera);
  return [dot(direction, right), dot(direction, up), dot(direction, back)];
}

/** A direction in view axes, in the world. */
export function fromView(camera: Camera, direction: Triple): Triple {
  const { right, up, back } = frameOf(camera);
  return add(add(scale(right, direction[0]), scale(up, direction[1])), scale(back, direction[2]));
}

/**
 * Where a world point is seen: from the viewport's centre in viewport heights, y upwards; null
 * behind the eye.
 */
export function project(camera: Camera, point: Triple): [number, number] | null {
  const [x, y, z] = toView(camera, sub(point, camera.target));
  const height = heightAtPivot(camera);
  if (camera.orthographic_height !== undefined) return [x / height, y / height];
  const { distance } = frameOf(camera);
  const depth = distance - z;
  if (depth <= 1e-6) return null;
  const k = distance / depth / height;
  return [x * k, y * k];
}
