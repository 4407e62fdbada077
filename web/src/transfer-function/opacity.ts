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

/** Height on the axis, 0..1, of an opacity. */
export const heightOf = (opacity: number, axis: OpacityAxis): number =>
  axis === "linear" ? clamp(opacity, 0, 1) : clamp(opacity, 0, 1) ** (1 / POWER);

/** Opacity at a height on the axis, 0..1. */
export const opacityAt = (height: number, axis: OpacityAxis): number =>
  axis === "linear" ? clamp(height, 0, 1) : clamp(height, 0, 1) ** POWER;
