/** What a pixel shows, and slices as people choose them. */

import type { Dataset, RenderingMode, SlicePlane } from "../generated/proto";
import { clamp, dot, normalize, rounded, type Triple } from "../scene/vec";

export const renderingModes: readonly { value: RenderingMode; label: string; gives: string }[] = [
  { value: "volume", label: "Volume in light", gives: "Matter of the transfer function, lit" },
  { value: "isosurface", label: "Isosurface", gives: "An opaque surface where the data have one value, lit" },
  { value: "slice", label: "Slice", gives: "Values on a plane, as greys of the window" },
  { value: "maximum", label: "Maximum (MIP)", gives: "The largest value on each ray, as a grey of the window" },
  { value: "minimum", label: "Minimum", gives: "The smallest value on each ray, as a grey of the window" },
  { value: "average", label: "Average", gives: "The mean value along each ray, as a grey of the window" },
];

/** Data below this are Hounsfield units: air lies near -1000. */
const AIR_BELOW = -500;

export const isHounsfield = (dataset: Pick<Dataset, "value_range"> | null): boolean => dataset !== null && dataset.value_range[0] < AIR_BELOW;

/** Windows by which radiologists read CT, Hounsfield units. */
export const tissueWindows: readonly { id: string; label: string; window: [number, number] }[] = [
  { id: "bone", label: "Bone", window: [-450, 1050] },
  { id: "soft", label: "Soft tissue", window: [-160, 240] },
  { id: "lung", label: "Lung", window: [-1350, 150] },
  { id: "brain", label: "Brain", window: [0, 80] },
];

export const axisNormals: readonly Triple[] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
export const gridSlices = ["Across x", "Across y", "Across z"] as const;
export const anatomicalSlices = ["Sagittal", "Coronal", "Axial"] as const;

/** The axis a slice lies across, or null where it is oblique. */
export function sliceAxis({ normal }: SlicePlane): 0 | 1 | 2 | null {
  const unit = normalize(normal);
  const axis = axisNormals.findIndex((along) => Math.abs(dot(unit, along)) > 1 - 1e-9);
  return axis === -1 ? null : (axis as 0 | 1 | 2);
}

/** Largest offset at which a plane of this normal meets the box with these half edges. */
export function sliceReach({ normal }: SlicePlane, half: Triple): number {
  const [x, y, z] = normalize(normal);
  return dot([Math.abs(x), Math.abs(y), Math.abs(z)], half);
}

/** Where the slice stands in the volume, 0..1 along its normal. */
export function sliceShare(plane: SlicePlane, half: Triple): number {
  const most = sliceReach(plane, half);
  return clamp((plane.offset + most) / (2 * most), 0, 1);
}

/** The slice moved to this share of the volume. */
export function sliceAt(plane: SlicePlane, share: number, half: Triple): SlicePlane {
  return { ...plane, offset: rounded((2 * share - 1) * sliceReach(plane, half), 5) };
}
