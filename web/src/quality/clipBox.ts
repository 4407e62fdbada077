/** The clip box and its place in the world: faces that can be pulled, edges, and planes across the volume. */

import type { Clip, ClipPlane } from "../generated/proto";
import { add, clamp, cross, dot, normalize, rounded, scale, sub, type Triple } from "../scene/vec";

export type Box = NonNullable<Clip["box"]>;
export type Axis = 0 | 1 | 2;
/** The lower or the upper face across an axis. */
export type Side = 0 | 1;

export const WHOLE: Box = [[0, 0, 0], [1, 1, 1]];
/** Thinnest slab that is kept, share of the edge. */
export const MIN_SLAB = 0.005;

export const gridNames = ["x", "y", "z"] as const;
export const anatomicalNames = ["Right – left", "Front – back", "Feet – head"] as const;

/** The box with one axis changed; null where nothing is cut. */
export function withAxis(box: Box, axis: Axis, [low, high]: readonly [number, number]): Box | null {
  const next: [Triple, Triple] = [[...box[0]], [...box[1]]];
  next[0][axis] = rounded(low, 4);
  next[1][axis] = rounded(high, 4);
  return next[0].every((x) => x === 0) && next[1].every((x) => x === 1) ? null : next;
}

/** The box with one face moved by a share of the volume's edge, as far as the volume and the opposite face allow. */
export function withFace(box: Box, axis: Axis, side: Side, by: number): Box | null {
  const [low, high] = [box[0][axis], box[1][axis]];
  return withAxis(box, axis, side === 0 ? [clamp(low + by, 0, high - MIN_SLAB), high] : [low, clamp(high + by, low + MIN_SLAB, 1)]);
}

/** A place in 0..1 volume coordinates in the world. */
export const inWorld = (share: Triple, half: Triple): Triple => share.map((x, axis) => (2 * x - 1) * (half[axis] ?? 0)) as Triple;

export function faceCentre(box: Box, axis: Axis, side: Side, half: Triple): Triple {
  const middle = scale(add(box[0], box[1]), 0.5);
  middle[axis] = box[side][axis];
  return inWorld(middle, half);
}

/** Direction in which a face looks. */
export function outwards(axis: Axis, side: Side): Triple {
  const direction: Triple = [0, 0, 0];
  direction[axis] = side === 0 ? -1 : 1;
  return direction;
}

/** Whether a face is seen from an eye (a place, or the direction to one infinitely far). */
export function isSeen(centre: Triple, direction: Triple, eye: { place: Triple } | { towards: Triple }): boolean {
  return dot(direction, "place" in eye ? sub(eye.place, centre) : eye.towards) > 0;
}

export interface Edge {
  ends: [Triple, Triple];
  /** The two faces that meet in it. */
  faces: [[Axis, Side], [Axis, Side]];
}

const SIDES: readonly Side[] = [0, 1];

/** The twelve edges, in the world. */
export function edgesOf(box: Box, half: Triple): Edge[] {
  return ([0, 1, 2] as const).flatMap((axis) => {
    const [first, second] = ([0, 1, 2] as const).filter((other) => other !== axis) as [Axis, Axis];
    return SIDES.flatMap((a) => SIDES.map((b) => {
      const end = (side: Side): Triple => {
        const corner: Triple = [0, 0, 0];
        corner[axis] = box[side][axis];
        corner[first] = box[a][first];
        corner[second] = box[b][second];
        return inWorld(corner, half);
      };
      return { ends: [end(0), end(1)], faces: [[first, a], [second, b]] } satisfies Edge;
    }));
  });
}

/** The outline of a plane within the volume, in order; empty where it passes it by. */
export function planeOutline({ normal, offset }: ClipPlane, half: Triple): Triple[] {
  const n = normalize(normal);
  const corners = edgesOf(WHOLE, half).flatMap(({ ends: [from, to] }) => {
    const [a, b] = [dot(n, from) - offset, dot(n, to) - offset];
    return a === b || a * b > 0 ? [] : [add(from, scale(sub(to, from), a / (a - b)))];
  });
  if (corners.length < 3) return [];
  const centre = scale(corners.reduce(add), 1 / corners.length);
  const u = normalize(sub(corners[0] ?? centre, centre));
  const v = cross(n, u);
  const angle = (corner: Triple) => Math.atan2(dot(sub(corner, centre), v), dot(sub(corner, centre), u));
  return corners.sort((a, b) => angle(a) - angle(b));
}

/** Where a plane's handle is: the middle of its outline, or the place nearest the volume's centre. */
export function planeCentre(plane: ClipPlane, half: Triple): Triple {
  const outline = planeOutline(plane, half);
  return outline.length > 0 ? scale(outline.reduce(add), 1 / outline.length) : scale(normalize(plane.normal), plane.offset);
}
