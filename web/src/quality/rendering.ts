/** What a pixel shows, and slices as people choose them. */

import type { Camera, Dataset, RenderingMode, SlicePlane } from "../generated/proto";
import { clamp, cross, dot, length, normalize, rounded, scale, type Triple } from "../scene/vec";
import { frameOf, lookFrom } from "../viewport/camera";
import { standardViews } from "../viewport/views";
import { halfEdges } from "./clipPlanes";

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

/** Cosine between the plane's normal and the view below which a slice is seen as a line. */
const EDGE_ON_COSINE = 0.1;

export const isEdgeOn = ({ normal }: SlicePlane, camera: Camera): boolean => Math.abs(dot(normalize(normal), frameOf(camera).back)) < EDGE_ON_COSINE;

/** From where slices across x, y and z are read: the patient's left, front and feet; else the positive side. */
const readFrom = (axis: 0 | 1 | 2, anatomical: boolean): Triple => {
  const [x, y, z] = axisNormals[axis] ?? [0, 0, 1];
  return anatomical && axis !== 0 ? [0 - x, 0 - y, 0 - z] : [x, y, z];
};

/** The view straight at a slice, as far away as before; an oblique one is seen from its nearer side. */
export function lookAtSlice(plane: SlicePlane, camera: Camera, anatomical: boolean): Camera {
  const axis = sliceAxis(plane);
  if (axis === null) {
    const normal = normalize(plane.normal);
    const from = scale(normal, dot(normal, frameOf(camera).back) < 0 ? -1 : 1);
    const upright = length(cross(camera.up, from)) > EDGE_ON_COSINE;
    return lookFrom(camera, from, upright ? camera.up : frameOf(camera).back);
  }
  const from = readFrom(axis, anatomical);
  const view = standardViews(anatomical).find((standard) => dot(standard.from, from) > 0.5);
  return lookFrom(camera, from, view?.up ?? camera.up);
}

/** Where a slice stands, in the terms of its data. */
export interface SlicePlace {
  /** From the volume's first face (an oblique slice: its first corner), in units of the spacing. */
  length: number;
  /** Number of the slice, from 1, and how many there are; null where the slice is oblique. */
  slice: { number: number; count: number } | null;
}

export function slicePlace(plane: SlicePlane, dataset: Pick<Dataset, "dims" | "spacing">, spacing: Triple | undefined): SlicePlace {
  const half = halfEdges(dataset, spacing);
  const edges = dataset.dims.map((voxels, axis) => voxels * ((spacing ?? dataset.spacing)[axis] ?? 1));
  const unitsPerWorld = Math.max(...edges);
  const share = sliceShare(plane, half);
  const axis = sliceAxis(plane);
  if (axis === null) return { length: share * 2 * sliceReach(plane, half) * unitsPerWorld, slice: null };
  // A normal against its axis counts from the far face.
  const along = (plane.normal[axis]) < 0 ? 1 - share : share;
  const count = dataset.dims[axis];
  return { length: along * (edges[axis] ?? 1), slice: { number: Math.min(count, Math.floor(along * count) + 1), count } };
}
