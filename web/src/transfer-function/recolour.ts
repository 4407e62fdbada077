/** Other colours for a curve that stays as it is: from a colour map, or from given stops. */

import type { TransferFunctionPoint } from "../generated/proto";
import { linearFromSrgb, srgbFromLinear } from "../scene/colour";
import { lerpTriple, rounded, type Triple } from "../scene/vec";
import { extinctionOf, opacityFromExtinction } from "./opacity";
import { matterAt } from "./points";
import type { Range } from "./valueAxis";

type Points = readonly TransferFunctionPoint[];

/** Linear colour at a place of a map, 0..1. */
export type ColourAt = (t: number) => Triple;

/** Difference of a channel, encoded, that is not seen between two neighbours of a map. */
const TOLERANCE = 0.025;
/** Most halvings of the way between two points. */
const MAX_HALVINGS = 4;
/** Relative difference of extinctions that are the same. */
const SAME_EXTINCTION = 1e-3;

/** The values over which a curve has matter: what a colour map is laid over. */
export function visibleSpan(points: Points): Range {
  const first = points.findIndex((point) => extinctionOf(point) > 0);
  if (first === -1) return [0, 1];
  const last = points.findLastIndex((point) => extinctionOf(point) > 0);
  const low = first === 0 ? 0 : (points[first - 1]?.s ?? 0);
  const high = last === points.length - 1 ? 1 : (points[last + 1]?.s ?? 1);
  return high > low ? [low, high] : [0, 1];
}

/**
 * The curve with the colours of a map, laid over the values `span`. Points that carried nothing but
 * a colour go, and as many come as the map needs: colours between points are mixed linearly.
 */
export function recolour(points: Points, colourAt: ColourAt, span: Range): TransferFunctionPoint[] {
  const inside = ({ s }: TransferFunctionPoint) => s >= span[0] && s <= span[1];
  const carried = points.filter((point, i) => !inside(point) || !carriesColourOnly(points[i - 1], point, points[i + 1]));
  const at = (s: number): Triple => colourAt(Math.min(1, Math.max(0, (s - span[0]) / (span[1] - span[0]))));
  const edges = span.filter((s) => !carried.some((point) => point.s === s));
  const framed = [...carried, ...edges.map((s) => pointOn(points, s))].sort((a, b) => a.s - b.s);
  const painted = framed.map((point) => (inside(point) ? { ...point, albedo: roundTriple(at(point.s)) } : point));
  return painted.flatMap((point, i) => {
    const next = painted[i + 1];
    if (!next || !inside(point) || !inside(next)) return [point];
    return [point, ...between(point.s, next.s, at, MAX_HALVINGS).map((s) => ({ ...pointOn(points, s), albedo: roundTriple(at(s)) }))];
  });
}

/** Places between two others at which the map needs a point. */
function between(low: number, high: number, at: ColourAt, halvings: number): number[] {
  if (halvings === 0 || high - low < 1e-4) return [];
  // The quarters, too: a map that is symmetric about the middle looks straight there.
  const straight = [0.25, 0.5, 0.75].every((t) => looksLike(lerpTriple(at(low), at(high), t), at(low + t * (high - low))));
  if (straight) return [];
  const middle = rounded((low + high) / 2);
  return [...between(low, middle, at, halvings - 1), middle, ...between(middle, high, at, halvings - 1)];
}

const looksLike = (a: Triple, b: Triple): boolean => a.every((channel, i) => Math.abs(srgbFromLinear(channel) - srgbFromLinear(b[i] ?? 0)) <= TOLERANCE);
const roundTriple = ([r, g, b]: Triple): Triple => [rounded(r, 5), rounded(g, 5), rounded(b, 5)];

/** A point that changes nothing of the curve. */
function pointOn(points: Points, s: number): TransferFunctionPoint {
  const { extinction, albedo, emission, material } = matterAt(points, s);
  const asOpacity = points.every((point) => point.extinction === undefined);
  return {
    s,
    ...(asOpacity ? { opacity: rounded(opacityFromExtinction(extinction)) } : { extinction: rounded(extinction) }),
    albedo: roundTriple(albedo),
    emission: roundTriple(emission),
    ...(material === undefined ? {} : { material }),
  };
}

/** Whether a point lies on the straight way between its neighbours in all but its colour. */
function carriesColourOnly(left: TransferFunctionPoint | undefined, point: TransferFunctionPoint, right: TransferFunctionPoint | undefined): boolean {
  if (!left || !right || left.s === point.s || right.s === point.s || left.material !== point.material) return false;
  const there = matterAt([left, right], point.s);
  const extinction = extinctionOf(point);
  const most = Math.max(extinctionOf(left), extinctionOf(right), extinction);
  return Math.abs(there.extinction - extinction) <= SAME_EXTINCTION * most && there.emission.every((e, i) => Math.abs(e - (point.emission[i] ?? 0)) <= 1e-4 * Math.max(1, e));
}

/** A map through stops (place 0..1, encoded sRGB 0..1), mixed as encoded values. */
export function throughStops(stops: readonly { t: number; srgb: Triple }[]): ColourAt {
  return (t) => {
    const after = stops.findIndex((stop) => stop.t > t);
    const to = stops[after === -1 ? stops.length - 1 : after];
    const from = stops[after === -1 ? stops.length - 1 : Math.max(0, after - 1)];
    if (!from || !to) return [1, 1, 1];
    const share = to.t > from.t ? Math.max(0, (t - from.t) / (to.t - from.t)) : 0;
    return lerpTriple(from.srgb, to.srgb, share).map(linearFromSrgb) as Triple;
  };
}
