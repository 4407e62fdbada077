/** Edits of the transfer function's points. All return new arrays; `s` stays ascending. */

import { MAX_TRANSFER_FUNCTION_POINTS, type TransferFunctionPoint } from "../generated/proto";
import { clamp, lerp, lerpTriple, rounded, type Triple } from "../scene/vec";
import { extinctionOf, heightOf, opacityAt, opacityFromExtinction, opacityOf, withOpacity, type OpacityScale } from "./opacity";

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

/**
 * Moves points together, by `ds` and by `dHeight` of the opacity axis. They go no further than the
 * points beside them that stay.
 */
export function movePoints(points: Points, indices: readonly number[], ds: number, dHeight: number, scale: OpacityScale): TransferFunctionPoint[] {
  const moving = new Set(indices);
  /** The place of the nearest point on one side that stays. */
  const stop = (from: number, side: -1 | 1): number => {
    let at = from + side;
    while (moving.has(at)) at += side;
    return points[at]?.s ?? (side < 0 ? 0 : 1);
  };
  const room = points.flatMap(({ s }, i) => (moving.has(i) ? [[stop(i, -1) - s, stop(i, 1) - s] as const] : []));
  const step = clamp(ds, Math.max(...room.map(([least]) => least)), Math.min(...room.map(([, most]) => most)));
  return points.map((point, i) => {
    if (!moving.has(i)) return point;
    // Clamped last: rounding could pass a neighbour that is not round.
    const moved = { ...point, s: clamp(rounded(point.s + step), stop(i, -1), stop(i, 1)) };
    return dHeight === 0 ? moved : withOpacity(moved, opacityAt(heightOf(opacityOf(point), scale) + dHeight, scale));
  });
}

/** Adds a point with the colour and material found there, with an opacity or on the curve (null); its index comes with the points. */
export function addPoint(points: Points, s: number, opacity: number | null): { points: TransferFunctionPoint[]; index: number } {
  if (points.length >= MAX_TRANSFER_FUNCTION_POINTS) return { points: [...points], index: -1 };
  const found = points.findIndex((point) => point.s > s);
  const index = found === -1 ? points.length : found;
  const { extinction, albedo, emission, material } = matterAt(points, s);
  const round = (t: Triple): Triple => [rounded(t[0]), rounded(t[1]), rounded(t[2])];
  const point: TransferFunctionPoint = { s: clamp(rounded(s), points[index - 1]?.s ?? 0, points[index]?.s ?? 1), opacity: rounded(opacity ?? opacityFromExtinction(extinction)), albedo: round(albedo), emission: round(emission) };
  if (material !== undefined) point.material = material;
  return { points: [...points.slice(0, index), point, ...points.slice(index)], index };
}

/** The middle of the widest gap between neighbours, or between a curve's end and the axis's. */
export function widestGap(points: Points): number {
  const places = [0, ...points.map(({ s }) => s), 1];
  const gaps = places.slice(1).map((s, i) => ({ from: places[i] ?? 0, width: s - (places[i] ?? 0) }));
  const widest = gaps.reduce((most, gap) => (gap.width > most.width ? gap : most), { from: 0, width: 0 });
  return widest.from + widest.width / 2;
}

/** Removes points; one of all stays. */
export function removePoints(points: Points, indices: readonly number[]): TransferFunctionPoint[] {
  const left = points.filter((_, i) => !indices.includes(i));
  return left.length > 0 ? left : points.slice(0, 1);
}

/** Replaces points by what `change` makes of them. */
export const changePoints = (
  points: Points,
  indices: readonly number[],
  change: (point: TransferFunctionPoint) => TransferFunctionPoint,
): TransferFunctionPoint[] => points.map((point, i) => (indices.includes(i) ? change(point) : point));

/**
 * Puts points into the curve in place of those between the first and the last of them; `indices`
 * tells where they are. Of a step at an end its outer side stays.
 */
export function insertPoints(points: Points, added: Points): { points: TransferFunctionPoint[]; indices: number[] } {
  const [low, high] = [added[0]?.s ?? 0, added.at(-1)?.s ?? 0];
  const lastBelow = points.findLastIndex(({ s }) => s <= low);
  const firstAbove = points.findIndex(({ s }) => s >= high);
  const before = points.filter(({ s }, i) => s < low || (s === low && i < lastBelow));
  const after = points.filter(({ s }, i) => s > high || (s === high && low < high && i > firstAbove));
  if (before.length + added.length + after.length > MAX_TRANSFER_FUNCTION_POINTS) return { points: [...points], indices: [] };
  return { points: [...before, ...added, ...after], indices: added.map((_, i) => before.length + i) };
}

/** The point with another material; null for none. */
export function withMaterial(point: TransferFunctionPoint, name: string | null): TransferFunctionPoint {
  const next = { ...point };
  if (name === null) delete next.material;
  else next.material = name;
  return next;
}
