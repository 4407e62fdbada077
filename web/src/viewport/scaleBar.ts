/** A length that fits a scale bar. The volume's longest edge is 1 world unit. */

import type { Camera, Dataset } from "../generated/proto";
import type { Triple } from "../scene/vec";
import { heightAtPivot } from "./camera";

/** Longest bar, CSS pixels. */
const MAX_BAR_PIXELS = 130;

export interface ScaleBar {
  /** CSS pixels. */
  pixels: number;
  /** Length with its unit. */
  label: string;
}

/** Physical units that one world unit is long; null where the spacing has no unit. */
export function unitsPerWorld(dataset: Dataset | null, spacing: Triple | undefined): number | null {
  if (!dataset?.spacing_unit) return null;
  const edges = dataset.dims.map((voxels, axis) => voxels * ((spacing ?? dataset.spacing)[axis] ?? 1));
  return Math.max(...edges);
}

/** The longest round bar (1, 2 or 5 times a power of ten) that fits, measured at the pivot's depth. */
export function scaleBar(camera: Camera, viewportHeight: number, units: number, unit: string): ScaleBar | null {
  const pixelsPerUnit = viewportHeight / (heightAtPivot(camera) * units);
  if (!Number.isFinite(pixelsPerUnit) || pixelsPerUnit <= 0) return null;
  const longest = MAX_BAR_PIXELS / pixelsPerUnit;
  const power = 10 ** Math.floor(Math.log10(longest));
  const step = [5, 2, 1].find((factor) => factor * power <= longest) ?? 1;
  const length = step * power;
  return { pixels: length * pixelsPerUnit, label: `${Number(length.toPrecision(1))} ${unit}` };
}
