/**
 * Opacity as people see it, extinction as the scene means it, and the editor's vertical axis.
 *
 * Opacity is that of `OPACITY_LENGTH` world units: `opacity = 1 - exp(-extinction * length)`.
 */

import { MAX_OPACITY, OPACITY_LENGTH, type TransferFunctionPoint } from "../generated/proto";
import { clamp, rounded } from "../scene/vec";

export const extinctionFromOpacity = (opacity: number): number =>
  -Math.log(1 - clamp(opacity, 0, MAX_OPACITY)) / OPACITY_LENGTH;

export const opacityFromExtinction = (extinction: number): number =>
  Math.min(MAX_OPACITY, 1 - Math.exp(-extinction * OPACITY_LENGTH));

/** Extinction of a point however it is given, per world unit. */
export const extinctionOf = (point: TransferFunctionPoint): number =>
  point.extinction ?? extinctionFromOpacity(point.opacity ?? 0);

/** Opacity of a point however it is given, 0..1. */
export const opacityOf = (point: TransferFunctionPoint): number =>
  point.opacity ?? opacityFromExtinction(point.extinction ?? 0);

/** The point with a new opacity, in the unit it was given in. */
export function withOpacity(point: TransferFunctionPoint, opacity: number): TransferFunctionPoint {
  const value = clamp(opacity, 0, 1);
  return point.extinction === undefined
    ? { ...point, opacity: rounded(value) }
    : { ...point, extinction: rounded(extinctionFromOpacity(value)) };
}

/** The same matter, given as opacity or as extinction. */
export function inUnit(point: TransferFunctionPoint, unit: "opacity" | "extinction"): TransferFunctionPoint {
  const { extinction, opacity, ...rest } = point;
  return unit === "opacity"
    ? { ...rest, opacity: opacity ?? rounded(opacityFromExtinction(extinction ?? 0)) }
    : { ...rest, extinction: extinction ?? rounded(extinctionFromOpacity(opacity ?? 0)) };
}

/** `power` spreads the opacities near zero, where thin matter lives. */
export type OpacityAxis = "linear" | "power";

/** Exponent of the power axis. */
const POWER = 3;

/** The editor's vertical scale. */
export interface OpacityScale {
  axis: OpacityAxis;
  /** Opacity at the upper end, > 0..1. */
  ceiling: number;
}

/** Height on the axis of an opacity: 0 at the lower end, 1 at the upper, more beyond it. */
export const heightOf = (opacity: number, { axis, ceiling }: OpacityScale): number => {
  const share = clamp(opacity, 0, 1) / ceiling;
  return axis === "linear" ? share : share ** (1 / POWER);
};

/** Opacity at a height on the axis; beyond the upper end it goes on up to 1. */
export const opacityAt = (height: number, { axis, ceiling }: OpacityScale): number => {
  const share = Math.max(0, height);
  return clamp(ceiling * (axis === "linear" ? share : share ** POWER), 0, 1);
};

/** Lowest upper end of the axis. */
const MIN_CEILING = 1e-4;
/** Room above the highest opacity that is shown. */
const HEADROOM = 1.1;

/** A round upper end (1, 2 or 5 times a power of ten, at most 1) above this opacity; 1 above none. */
export function ceilingAbove(opacity: number): number {
  if (opacity <= 0) return 1;
  const least = Math.max(MIN_CEILING, opacity * HEADROOM);
  const power = 10 ** Math.floor(Math.log10(least));
  const factor = [1, 2, 5].find((round) => round * power >= least * (1 - 1e-9)) ?? 10;
  return Math.min(1, Number((factor * power).toPrecision(1)));
}
