/** Edits of the transfer function's points. All return new arrays; `s` stays ascending. */

import { MAX_TRANSFER_FUNCTION_POINTS, type TransferFunctionPoint } from "../generated/proto";
import { clamp, lerp, lerpTriple, rounded, type Triple } from "../scene/vec";
import { extinctionOf, heightOf, opacityAt, opacityFromExtinction, opacityOf, withOpacity, type OpacityAxis } from "./opacity";

type Points = readonly TransferFunctionPoint[];

/** Matter at one value. */
export interface Matter {
  extinction: number;
  albedo: Triple;
  emission: Triple;
  material?: string | undefined;
}

/** Matter at `s`: linear between the neighbours, constant beyond the ends, a step's later point at the step. */
export function matterAt(points: Points, s: number): Matter {
  const after = points.findIndex((point) => point.s > s);
  const right = points[after];
  const left = points[after === -1 ? points.length - 1 : after - 1];
  const from = left ?? right;
  if (!from) return { extinction: 0, albedo: [1, 1, 1], emission: [0, 0, 0] };
  const to = right ?? from;
  const t = to.s > from.s ? clamp((s - from.s) / (to.s - from.s), 0, 1) : 0;
  return {
    extinction: lerp(extinctionOf(from), extinctionOf(to), t),
    albedo: lerpTriple(from.albedo, to.albedo, t),
    emission: lerpTriple(from.emission, to.emission, t),
    material: left?.material,
  };
}

export const opacityAtValue = (points: Points, s: number): number => opacityFromExtinction(matterAt(points, s).extinction);

/** Moves a point to `s` and, unless null, to `opacity`; it stays between its neighbours. */
export function movePoint(points: Points, index: number, s: number, opacity: number | null): TransferFunctionPoint[] {
  return points.map((point, i) => {
    if (i !== index) return point;
    const low = points[index - 1]?.s ?? 0;
    const high = points[index + 1]?.s ?? 1;
    // Clamped last: rounding could pass a neighbour that is not round.
    const moved = { ...point, s: clamp(rounded(s), low, high) };
    return opacity === null ? moved : withOpacity(moved, opacity);
  });
}

/** Moves a point and its right neighbour together, by `ds` and `dHeight` of the opacity axis. */
export function moveBand(points: Points, left: number, ds: number, dHeight: number, axis: OpacityAxis): TransferFunctionPoint[] {
  const low = points[left - 1]?.s ?? 0;
  const high = points[left + 2]?.s ?? 1;
  const step = clamp(ds, low - (points[left]?.s ?? 0), high - (points[left + 1]?.s ?? 1));
  return points.map((point, i) => {
    if (i !== left && i !== left + 1) return point;
    const moved = { ...point, s: clamp(rounded(point.s + step), low, high) };
    if (dHeight === 0) return moved;
    return withOpacity(moved, opacityAt(heightOf(opacityOf(point), axis) + dHeight, axis));
  });
}

/** Adds a point with the colour and material found there; its index comes with the points. */
export function addPoint(points: Points, s: number, opacity: number): { points: TransferFunctionPoint[]; index: number } {
  if (points.length >= MAX_TRANSFER_FUNCTION_POINTS) return { points: [...points], index: -1 };
  const found = points.findIndex((point) => point.s > s);
  const index = found === -1 ? points.length : found;
  const { albedo, emission, material } = matterAt(points, s);
  const round = (t: Triple): Triple => [rounded(t[0]), rounded(t[1]), rounded(t[2])];
  const point: TransferFunctionPoint = { s: clamp(rounded(s), points[index - 1]?.s ?? 0, points[index]?.s ?? 1), opacity: rounded(opacity), albedo: round(albedo), emission: round(emission) };
  if (material !== undefined) point.material = material;
  return { points: [...points.slice(0, index), point, ...points.slice(index)], index };
}

/** Removes a point; the last one stays. */
export const removePoint = (points: Points, index: number): TransferFunctionPoint[] =>
  points.length > 1 ? points.filter((_, i) => i !== index) : [...points];

/** Replaces a point by what `change` makes of it. */
export const changePoint = (
  points: Points,
  index: number,
  change: (point: TransferFunctionPoint) => TransferFunctionPoint,
): TransferFunctionPoint[] => points.map((point, i) => (i === index ? change(point) : point));

/** The point with another material; null for none. */
export function withMaterial(point: TransferFunctionPoint, name: string | null): TransferFunctionPoint {
  const next = { ...point };
  if (name === null) delete next.material;
  else next.material = name;
  return next;
}
