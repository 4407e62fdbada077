/** From transfer function to drawing: pixels of the plot and SVG paths. */

import type { TransferFunctionPoint } from "../generated/proto";
import { lerp } from "../scene/vec";
import { ceilingAbove, extinctionOf, heightOf, opacityAt, opacityFromExtinction, opacityOf, type OpacityScale } from "./opacity";
import { opacityAtValue } from "./points";
import type { Range } from "./valueAxis";

/** The plot: its area in pixels, what part of `s` it shows, and its vertical scale. */
export interface Plot extends OpacityScale {
  left: number;
  top: number;
  width: number;
  height: number;
  window: Range;
}

/** Samples of the curve between two points: opacity is not linear where extinction is. */
const SEGMENT_SAMPLES = 24;

export const xOf = (plot: Plot, s: number): number =>
  plot.left + ((s - plot.window[0]) / (plot.window[1] - plot.window[0])) * plot.width;
export const yOf = (plot: Plot, opacity: number): number => plot.top + (1 - heightOf(opacity, plot)) * plot.height;
export const sAt = (plot: Plot, x: number): number =>
  plot.window[0] + ((x - plot.left) / plot.width) * (plot.window[1] - plot.window[0]);
export const opacityAtY = (plot: Plot, y: number): number => opacityAt(1 - (y - plot.top) / plot.height, plot);

/** The upper end of the opacity axis for a window: 1 for all values, just above the curve where they are zoomed. */
export function ceilingFor(points: readonly TransferFunctionPoint[], window: Range): number {
  const [low, high] = window;
  if (low <= 0 && high >= 1) return 1;
  const inside = points.filter(({ s }) => s >= low && s <= high).map(opacityOf);
  return ceilingAbove(Math.max(...inside, opacityAtValue(points, low), opacityAtValue(points, high)));
}

/** Two opposite corners of a rectangle, pixels. */
export interface Rubber {
  x: number;
  y: number;
  toX: number;
  toY: number;
}

/** The points whose handles lie in a rectangle. */
export const pointsWithin = (plot: Plot, points: readonly TransferFunctionPoint[], { x, y, toX, toY }: Rubber): number[] =>
  points.flatMap((point, index) => {
    const [px, py] = [xOf(plot, point.s), yOf(plot, opacityOf(point))];
    const inside = px >= Math.min(x, toX) && px <= Math.max(x, toX) && py >= Math.min(y, toY) && py <= Math.max(y, toY);
    return inside ? [index] : [];
  });

type Corner = readonly [number, number];

/** Corners of the curve between two points. */
function segment(plot: Plot, from: TransferFunctionPoint, to: TransferFunctionPoint): Corner[] {
  const [a, b] = [extinctionOf(from), extinctionOf(to)];
  const samples = from.s === to.s || a === b ? 1 : SEGMENT_SAMPLES;
  return Array.from({ length: samples + 1 }, (_, i) => {
    const t = i / samples;
    return [xOf(plot, lerp(from.s, to.s, t)), yOf(plot, opacityFromExtinction(lerp(a, b, t)))] as const;
  });
}

const path = (corners: Corner[]): string => corners.map(([x, y], i) => `${i === 0 ? "M" : "L"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");

/** The whole curve, constant beyond the outer points. */
export function curvePath(plot: Plot, points: readonly TransferFunctionPoint[]): string {
  const first = points[0];
  const last = points.at(-1);
  if (!first || !last) return "";
  const inner = points.slice(1).flatMap((point, i) => segment(plot, points[i] ?? first, point));
  return path([[xOf(plot, 0), yOf(plot, opacityOf(first))], ...inner, [xOf(plot, 1), yOf(plot, opacityOf(last))]]);
}

/** The area under an SVG path that runs across the plot. */
export const areaUnder = (plot: Plot, curve: string): string =>
  `${curve}L${xOf(plot, 1).toFixed(1)} ${plot.top + plot.height}L${xOf(plot, 0).toFixed(1)} ${plot.top + plot.height}Z`;

/** The area between a point and its right neighbour. */
export function bandPath(plot: Plot, from: TransferFunctionPoint, to: TransferFunctionPoint): string {
  const floor = plot.top + plot.height;
  return path([[xOf(plot, from.s), floor], ...segment(plot, from, to), [xOf(plot, to.s), floor]]);
}

/** Columns of a histogram (heights 0..1) as one filled path. */
export function columnsPath(plot: Plot, heights: readonly number[]): string {
  const floor = plot.top + plot.height;
  const step = plot.width / heights.length;
  const tops = heights.map((height, i) => {
    const y = (floor - height * plot.height).toFixed(1);
    return `L${(plot.left + i * step).toFixed(1)} ${y}L${(plot.left + (i + 1) * step).toFixed(1)} ${y}`;
  });
  return `M${plot.left} ${floor}${tops.join("")}L${plot.left + plot.width} ${floor}Z`;
}
