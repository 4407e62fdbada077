/** Transfer functions made for this volume, from its histogram. */

import type { Histogram, Material, TransferFunctionPoint } from "../generated/proto";
import { clamp, rounded, type Triple } from "../scene/vec";
import { positionOf, type Range } from "./valueAxis";

export interface Preset {
  id: string;
  label: string;
  /** What it shows. */
  hint: string;
  points: TransferFunctionPoint[];
  /** Materials its points name. */
  materials: Record<string, Material>;
}

/** Material of presets that show surfaces. */
const SURFACE = "preset_surface";
const surfaceMaterial: Material = {
  phase: { type: "isotropic" },
  surface: 0.9,
  brdf: { type: "blinn_phong", diffuse: 0.9, specular: 0.04, exponent: 40 },
};

const grey = (level: number): Triple => [level, level, level];
const skin: Triple = [0.86, 0.47, 0.33];
const muscle: Triple = [0.72, 0.24, 0.18];
const bone: Triple = [0.93, 0.88, 0.76];

/** Data values that hold at most the given share of the voxels below them. */
export function quantile(histogram: Histogram, share: number): number {
  const { counts, value_range: [low, high] } = histogram;
  const total = counts.reduce((a, b) => a + b, 0);
  let below = 0;
  for (const [bucket, count] of counts.entries()) {
    below += count;
    if (below >= share * total) return low + ((bucket + 0.5) / counts.length) * (high - low);
  }
  return high;
}

/** The value that best parts the voxels into two groups (Otsu: largest variance between them). */
export function otsuThreshold(histogram: Histogram): number {
  const { counts, value_range: [low, high] } = histogram;
  const total = counts.reduce((a, b) => a + b, 0);
  const sum = counts.reduce((a, count, bucket) => a + count * bucket, 0);
  let weight = 0;
  let weightedSum = 0;
  let best = { variance: -1, from: 0, to: 0 };
  for (const [bucket, count] of counts.entries()) {
    weight += count;
    weightedSum += count * bucket;
    if (weight === 0 || weight === total) continue;
    const gap = weightedSum / weight - (sum - weightedSum) / (total - weight);
    const variance = weight * (total - weight) * gap * gap;
    // Empty buckets between the groups tie: the middle of the gap is the threshold.
    if (variance > best.variance * (1 + 1e-12)) best = { variance, from: bucket, to: bucket };
    else if (variance >= best.variance * (1 - 1e-12)) best.to = bucket;
  }
  return low + (((best.from + best.to) / 2 + 1) / counts.length) * (high - low);
}

/** Hounsfield-like: air far below zero, bone well above. */
export function looksLikeCt(histogram: Histogram): boolean {
  const [low, high] = histogram.value_range;
  return low <= -400 && low >= -5000 && high >= 300 && high <= 40000;
}

/** The presets that suit a volume. `range` gives the data values of `s` = 0 and 1. */
export function presetsFor(histogram: Histogram, range: Range, surfaceValue?: number): Preset[] {
  const at = (value: number) => rounded(clamp(positionOf(value, range), 0, 1), 5);
  const point = (value: number, opacity: number, albedo: Triple, material?: string): TransferFunctionPoint => ({
    s: at(value), opacity, albedo, emission: [0, 0, 0], ...(material === undefined ? {} : { material }),
  });
  const span = range[1] - range[0];
  const threshold = surfaceValue ?? otsuThreshold(histogram);
  const top = Math.max(quantile(histogram, 0.999), threshold + 0.1 * span);
  const edge = 0.02 * span;

  const presets: Preset[] = [
    {
      id: "ramp", label: "Ramp", hint: "Everything above the background, thin to dense", materials: {},
      points: [point(range[0], 0, grey(0.9)), point(threshold * 0.5 + range[0] * 0.5, 0, grey(0.9)), point(top, 0.45, [0.95, 0.82, 0.62])],
    },
    {
      id: "surface", label: "Surface", hint: "A solid surface at the value that parts matter from background",
      materials: { [SURFACE]: surfaceMaterial },
      points: [
        point(range[0], 0, [0.85, 0.8, 0.72], SURFACE), point(threshold - edge, 0, [0.85, 0.8, 0.72], SURFACE),
        point(threshold + edge, 0.85, [0.9, 0.84, 0.74], SURFACE), point(top, 0.95, [0.95, 0.92, 0.86], SURFACE),
      ],
    },
    {
      id: "layers", label: "Veil and core", hint: "A thin veil around a dense core", materials: { [SURFACE]: surfaceMaterial },
      points: [
        point(range[0], 0, skin), point(threshold - 2 * edge, 0, skin), point(threshold, 0.03, skin),
        point(threshold + 2 * edge, 0.012, skin), point((threshold + top) / 2, 0.015, muscle),
        point((threshold + 2 * top) / 3, 0.6, bone, SURFACE), point(range[1], 0.85, bone, SURFACE),
      ],
    },
    {
      id: "grayscale", label: "Grayscale", hint: "Dark for low values, bright for high ones", materials: {},
      points: [point(range[0], 0, grey(0)), point(quantile(histogram, 0.5), 0.01, grey(0.15)), point(top, 0.25, grey(1))],
    },
  ];
  if (looksLikeCt(histogram)) {
    presets.splice(2, 0, {
      id: "ct", label: "Soft tissue + bone", hint: "Translucent soft tissue, solid bone (Hounsfield units)",
      materials: { [SURFACE]: surfaceMaterial },
      points: [
        point(range[0], 0, skin), point(-300, 0, skin), point(-20, 0.012, skin), point(60, 0.03, muscle),
        point(180, 0.03, muscle), point(280, 0.5, bone, SURFACE), point(1200, 0.9, [0.97, 0.95, 0.9], SURFACE),
      ],
    }, {
      id: "bone", label: "Bone", hint: "Solid bone and nothing else (Hounsfield units)",
      materials: { [SURFACE]: surfaceMaterial },
      points: [
        point(range[0], 0, bone, SURFACE), point(180, 0, bone, SURFACE), point(260, 0.6, bone, SURFACE),
        point(500, 0.9, bone, SURFACE), point(1200, 0.95, [0.97, 0.95, 0.9], SURFACE),
      ],
    });
  }
  return presets.map((preset) => ({ ...preset, points: ascending(preset.points) }));
}

/** Keeps `s` ascending where the volume's range squeezes points together. */
function ascending(points: TransferFunctionPoint[]): TransferFunctionPoint[] {
  let s = 0;
  return points.map((point) => {
    s = Math.max(s, point.s);
    return { ...point, s };
  });
}
