/** Places of the world in pixels of the viewport, and back along given directions. */

import type { Camera } from "../generated/proto";
import { add, scale, type Triple } from "../scene/vec";
import { frameOf, heightAtPivot, project, toView } from "./camera";

/** CSS pixels. */
export interface ViewportSize {
  width: number;
  height: number;
}

/** CSS pixels from the upper left corner. */
export interface Place {
  x: number;
  y: number;
}

/** Length over which directions are measured, world units. */
const SMALL = 1e-3;
/** Pixels per world unit below which a direction points at the viewer. */
const MIN_STEP_SHARE = 0.15;

/** Where a point is seen; null behind the eye. */
export function seenAt(camera: Camera, viewport: ViewportSize, point: Triple): Place | null {
  const at = project(camera, point);
  return at && { x: viewport.width / 2 + at[0] * viewport.height, y: viewport.height / 2 - at[1] * viewport.height };
}

export const isInside = ({ x, y }: Place, { width, height }: ViewportSize): boolean => x > 0 && y > 0 && x < width && y < height;

/** World units of one pixel parallel to the picture, at the depth of a point. */
export function unitsPerPixel(camera: Camera, viewport: ViewportSize, point: Triple): number {
  const { distance } = frameOf(camera);
  const nearer = toView(camera, point)[2] - toView(camera, camera.target)[2];
  const depth = camera.orthographic_height === undefined ? (distance - nearer) / distance : 1;
  return (heightAtPivot(camera) * depth) / viewport.height;
}

/** A move of the pointer as a move parallel to the picture, at the depth of a point. */
export function inPicture(camera: Camera, viewport: ViewportSize, point: Triple, dx: number, dy: number): Triple {
  const { right, up } = frameOf(camera);
  const k = unitsPerPixel(camera, viewport, point);
  return add(scale(right, dx * k), scale(up, -dy * k));
}

/**
 * World units along `direction` (of length 1) by which a point follows the pointer. Where the
 * direction points at the viewer, upwards goes along it.
 */
export function along(camera: Camera, viewport: ViewportSize, point: Triple, direction: Triple, dx: number, dy: number): number {
  const from = seenAt(camera, viewport, point);
  const to = seenAt(camera, viewport, add(point, scale(direction, SMALL)));
  const pixels = 1 / unitsPerPixel(camera, viewport, point);
  if (!from || !to) return 0;
  const [x, y] = [(to.x - from.x) / SMALL, (to.y - from.y) / SMALL];
  if (Math.hypot(x, y) < MIN_STEP_SHARE * pixels) return -dy / pixels;
  return (dx * x + dy * y) / (x * x + y * y);
}

/** Lines through points of the world as an SVG path; what lies behind the eye is left out. */
export function pathThrough(camera: Camera, viewport: ViewportSize, points: readonly Triple[], closed: boolean): string {
  let path = "";
  let drawing = false;
  for (const point of closed ? [...points, ...points.slice(0, 1)] : points) {
    const at = seenAt(camera, viewport, point);
    if (at) path += `${drawing ? "L" : "M"}${at.x.toFixed(1)} ${at.y.toFixed(1)}`;
    drawing = at !== null;
  }
  return path;
}
