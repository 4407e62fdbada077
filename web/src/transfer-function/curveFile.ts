/**
 * A transfer function as text: what is copied, saved and opened.
 *
 * A whole curve is a merge patch of a scene, so that it also serves `tyndall render --edit`. Of
 * other programs' files, 3D Slicer's volume properties (`.vp`) and ParaView's colour maps (`.json`)
 * are read.
 */

import { MAX_TRANSFER_FUNCTION_POINTS, type Material, type TransferFunctionPoint } from "../generated/proto";
import { lerp, rounded, type Triple } from "../scene/vec";
import { ontoRange } from "./reframe";
import { throughStops, type ColourAt } from "./recolour";
import { positionOf, valueOf, type Range } from "./valueAxis";

export interface CurveText {
  value_range: Range;
  transfer_function: { points: readonly TransferFunctionPoint[] };
  materials: Record<string, Material>;
  /** Only some points of a curve. */
  part?: true;
}

export type Read =
  /** Data values of `s` = 0 and 1; null where they are those of whatever volume. */
  | { kind: "curve"; range: Range | null; points: TransferFunctionPoint[]; materials: Record<string, Material>; part: boolean }
  /** Colours without a curve. */
  | { kind: "colours"; at: ColourAt };

const NOT_A_CURVE = "This is not a transfer function: it is read as saved here, as a volume property of 3D Slicer (.vp), or as a colour map of ParaView (.json).";

/** Points of a curve over the data values `range`, with the materials they name. */
export function curveText(points: readonly TransferFunctionPoint[], range: Range, materials: Record<string, Material>, part: boolean): string {
  const named = new Set(points.map(({ material }) => material));
  const used = Object.fromEntries(Object.entries(materials).filter(([name]) => named.has(name)));
  const text: CurveText = { value_range: range, transfer_function: { points }, materials: used, ...(part ? { part } : {}) };
  return `${JSON.stringify(text, null, 2)}\n`;
}

/** Reads a transfer function; throws an error in words if the text is none. */
export function readCurve(text: string): Read {
  const json = parsed(text);
  if (json === undefined) return slicerProperty(text);
  return Array.isArray(json) ? paraViewMap((json as unknown[])[0]) : ownCurve(json);
}

function parsed(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch {
    // Not JSON: perhaps a text of another program.
    return undefined;
  }
}

const isNumber = (value: unknown): value is number => typeof value === "number" && Number.isFinite(value);

function ownCurve(json: unknown): Read {
  const { value_range: range, transfer_function: curve, materials = {}, part = false } = (json ?? {}) as Partial<CurveText>;
  const points: unknown = curve?.points;
  if (!Array.isArray(points) || points.length === 0 || points.length > MAX_TRANSFER_FUNCTION_POINTS) throw new Error(NOT_A_CURVE);
  const whole = points.map(pointFrom);
  if (whole.some(({ s }, i) => s < (whole[i - 1]?.s ?? 0))) throw new Error("The points of this transfer function do not ascend.");
  return { kind: "curve", points: whole, materials: materialsFrom(materials), part, range: range === undefined ? null : rangeFrom(range) };
}

const isColour = (value: unknown): value is Triple => Array.isArray(value) && value.length === 3 && value.every((channel) => isNumber(channel) && channel >= 0);

/** A point with all that the page relies on; what else is wrong with it the service says. */
function pointFrom(value: unknown, index: number): TransferFunctionPoint {
  const { s, opacity, extinction, albedo = [1, 1, 1], emission = [0, 0, 0], material } = (value ?? {}) as Record<keyof TransferFunctionPoint, unknown>;
  const wrong = (what: string) => new Error(`Point ${index + 1} of this transfer function: ${what}.`);
  if (!isNumber(s) || s < 0 || s > 1) throw wrong("`s` must be from 0 to 1");
  if (opacity !== undefined && !isNumber(opacity)) throw wrong("`opacity` must be a number");
  if (extinction !== undefined && !isNumber(extinction)) throw wrong("`extinction` must be a number");
  if (!isColour(albedo) || !isColour(emission)) throw wrong("`albedo` and `emission` must be three numbers of at least 0");
  return {
    s, albedo, emission,
    ...(opacity === undefined ? {} : { opacity }),
    ...(extinction === undefined ? {} : { extinction }),
    ...(typeof material === "string" ? { material } : {}),
  };
}

/** Materials with a phase function; what else is wrong with them the service says. */
function materialsFrom(value: unknown): Record<string, Material> {
  const isMaterial = (material: unknown) => typeof material === "object" && material !== null && "phase" in material;
  if (typeof value !== "object" || value === null || !Object.values(value).every(isMaterial)) throw new Error("The materials of this transfer function are none.");
  return Object.fromEntries(Object.entries(value as Record<string, Material>).map(([name, material]) => [name, { ...material, surface: isNumber(material.surface) ? material.surface : 0 }]));
}

function rangeFrom(range: unknown): Range {
  const [low, high] = Array.isArray(range) ? (range as unknown[]) : [];
  if (!isNumber(low) || !isNumber(high) || high <= low) throw new Error("The value range of this transfer function is none.");
  return [low, high];
}

/** The points of a curve over other data values: at their own values, or stretched where they have none or none of them occurs. */
export function onto(points: readonly TransferFunctionPoint[], from: Range | null, to: Range): { points: TransferFunctionPoint[]; stretched: boolean } {
  if (from === null) return { points: [...points], stretched: false };
  const apart = from[1] <= to[0] || from[0] >= to[1];
  return apart ? { points: [...points], stretched: true } : { points: ontoRange(points, from, to), stretched: false };
}

/** Copied points at their own data values, or beginning at the place `s`; what reaches beyond the ends goes. */
export function placed(points: readonly TransferFunctionPoint[], from: Range | null, to: Range, s: number | null): TransferFunctionPoint[] {
  // Exactly where they were: rounding would tear a step apart.
  if (s === null && (from === null || (from[0] === to[0] && from[1] === to[1]))) return [...points];
  const own = points.map((point) => ({ ...point, s: from ? positionOf(valueOf(point.s, from), to) : point.s }));
  const shift = s === null ? 0 : s - (own[0]?.s ?? 0);
  return own.map((point) => ({ ...point, s: rounded(point.s + shift) })).filter((point) => point.s >= 0 && point.s <= 1);
}

/** Nodes of another program: data value and opacity, data value and colour (encoded sRGB). */
interface Nodes {
  opacity: readonly (readonly [number, number])[];
  colours: readonly { value: number; srgb: Triple }[];
}

function fromNodes({ opacity, colours }: Nodes): Read {
  const [low, high] = [colours[0]?.value ?? 0, colours.at(-1)?.value ?? 0];
  const colourAt = throughStops(colours.map(({ value, srgb }) => ({ t: high > low ? (value - low) / (high - low) : 0, srgb })));
  if (opacity.length === 0) {
    if (colours.length === 0) throw new Error(NOT_A_CURVE);
    return { kind: "colours", at: colourAt };
  }
  const values = [...new Set([...opacity.map(([value]) => value), ...colours.map(({ value }) => value)])].sort((a, b) => a - b);
  const range = rangeFrom([values[0], values.at(-1)]);
  return {
    kind: "curve", range, materials: {}, part: false,
    points: values.slice(0, MAX_TRANSFER_FUNCTION_POINTS).map((value) => {
      const [r, g, b] = colours.length === 0 ? [1, 1, 1] as const : colourAt(high > low ? (value - low) / (high - low) : 0);
      return { s: rounded(positionOf(value, range)), opacity: rounded(opacityOn(opacity, value)), albedo: [rounded(r, 5), rounded(g, 5), rounded(b, 5)], emission: [0, 0, 0] };
    }),
  };
}

function opacityOn(nodes: Nodes["opacity"], value: number): number {
  const after = nodes.findIndex(([at]) => at > value);
  const [from, to] = [nodes[after === -1 ? nodes.length - 1 : Math.max(0, after - 1)], nodes[after === -1 ? nodes.length - 1 : after]];
  if (!from || !to) return 0;
  const share = to[0] > from[0] ? Math.max(0, (value - from[0]) / (to[0] - from[0])) : 0;
  return Math.min(1, Math.max(0, lerp(from[1], to[1], share)));
}

/** Numbers in groups of `size`. */
function grouped(numbers: readonly number[], size: number): number[][] {
  return Array.from({ length: Math.floor(numbers.length / size) }, (_, i) => numbers.slice(i * size, (i + 1) * size));
}

interface ParaViewMap {
  RGBPoints?: unknown;
  Points?: unknown;
}

/** Colours as value, red, green, blue; opacities as value, opacity, midpoint, sharpness. */
function paraViewMap(first: unknown): Read {
  const entry = first as ParaViewMap | null | undefined;
  const numbers = (list: unknown): number[] => (Array.isArray(list) && list.every(isNumber) ? list : []);
  const colours = grouped(numbers(entry?.RGBPoints), 4).map(([value = 0, r = 0, g = 0, b = 0]) => ({ value, srgb: [r, g, b] as Triple }));
  const opacity = grouped(numbers(entry?.Points), 4).map(([value = 0, height = 0]) => [value, height] as const);
  return fromNodes({ opacity, colours });
}

/** Lines of a count and as many numbers: value and opacity, the same of gradients, value and colour. */
function slicerProperty(text: string): Read {
  const lists = text.split("\n").flatMap((line) => {
    const [count, ...numbers] = line.trim().split(/\s+/).map(Number);
    return count !== undefined && numbers.length >= 2 && numbers.length === count && numbers.every(isNumber) ? [numbers] : [];
  });
  const [opacity, colour] = [lists[0], lists.at(-1)];
  if (lists.length < 2 || !opacity || !colour || colour.length % 4 !== 0) throw new Error(NOT_A_CURVE);
  return fromNodes({
    opacity: grouped(opacity, 2).map(([value = 0, height = 0]) => [value, height] as const),
    colours: grouped(colour, 4).map(([value = 0, r = 0, g = 0, b = 0]) => ({ value, srgb: [r, g, b] as Triple })),
  });
}
