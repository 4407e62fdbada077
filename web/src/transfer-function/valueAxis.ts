/** The editor's horizontal axis: data values in a window that can be zoomed. */

import type { Dataset, Histogram, SceneFile } from "../generated/proto";
import { clamp } from "../scene/vec";

export type Range = readonly [number, number];

/** Narrowest window, as a share of the whole range. */
export const MIN_WINDOW = 1e-3;
/** Integer data over at least this many values are shown without decimals. */
const WHOLE_SPAN = 100;

/** The data values of `s` = 0 and 1. */
export function valueRange(scene: Pick<SceneFile, "value_range"> | null, dataset: Dataset | null): Range {
  const [low, high] = scene?.value_range ?? dataset?.value_range ?? [0, 1];
  return high > low ? [low, high] : [low, low + 1];
}

/** Whether values of this dataset are read as whole numbers. */
export function wholeValues(dataset: Pick<Dataset, "voxel_type" | "value_range"> | null): boolean {
  return dataset !== null && /^u?int/.test(dataset.voxel_type) && dataset.value_range[1] - dataset.value_range[0] >= WHOLE_SPAN;
}

export const valueOf = (s: number, [low, high]: Range): number => low + s * (high - low);
export const positionOf = (value: number, [low, high]: Range): number => (value - low) / (high - low);

/** The window (in `s`) after zooming by `factor` about `s`; < 1 comes nearer. Never leaves 0..1. */
export function zoomWindow([low, high]: Range, s: number, factor: number): Range {
  const width = clamp((high - low) * factor, MIN_WINDOW, 1);
  const share = (s - low) / (high - low);
  const start = clamp(s - share * width, 0, 1 - width);
  return [start, start + width];
}

/** The window moved by `ds`, kept within 0..1. */
export function panWindow([low, high]: Range, ds: number): Range {
  const step = clamp(ds, -low, 1 - high);
  return [low + step, high + step];
}

/** Round values inside `range`, about `count` of them. */
export function ticks([low, high]: Range, count: number): number[] {
  const raw = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = ([1, 2, 5, 10].find((factor) => factor * power >= raw) ?? 10) * power;
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}

/** A data value in few characters. */
export function formatValue(value: number): string {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) return value.toExponential(1);
  return String(Number(value.toPrecision(4)));
}

/** A data value of this dataset in few characters. */
export const formatData = (value: number, whole: boolean): string => (whole ? String(Math.round(value) + 0) : formatValue(value));

/**
 * Heights 0..1 of `columns` equal columns over `window` (data values): the fullest bucket that a
 * column touches, relative to the fullest of the window, on a linear or logarithmic scale.
 */
export function histogramColumns(histogram: Pick<Histogram, "counts" | "value_range">, window: Range, columns: number, log: boolean): number[] {
  const { counts, value_range: [low, high] } = histogram;
  const buckets = counts.length;
  if (buckets === 0 || high <= low) return [];
  const measure = log ? Math.log1p : (count: number) => count;
  const bucketAt = (value: number) => ((value - low) / (high - low)) * buckets;
  const most = Array.from({ length: columns }, (_, column) => {
    const from = bucketAt(window[0] + ((window[1] - window[0]) * column) / columns);
    const to = bucketAt(window[0] + ((window[1] - window[0]) * (column + 1)) / columns);
    const touched = counts.slice(Math.max(0, Math.floor(from)), Math.max(0, Math.ceil(to)));
    return touched.reduce((a, b) => Math.max(a, b), 0);
  });
  const fullest = measure(most.reduce((a, b) => Math.max(a, b), 1));
  return most.map((count) => measure(count) / fullest);
}
