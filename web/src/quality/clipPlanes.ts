/**
 * Clip planes as people move them: by the share of the volume that is cut away.
 *
 * A plane keeps the points x with dot(normal, x) >= offset (world; the volume's centre is the
 * origin). Along its normal the volume reaches from -reach to reach.
 */

import type { Camera, ClipPlane, Dataset } from "../generated/proto";
import { clamp, dot, normalize, rounded, scale, type Triple } from "../scene/vec";
import { frameOf } from "../viewport/camera";

/** Half the edges of the volume's box, world units: its longest edge is 1. */
export function halfEdges(dataset: Pick<Dataset, "dims" | "spacing"> | null, spacing: Triple | undefined): Triple {
  if (!dataset) return [0.5, 0.5, 0.5];
  const [x, y, z] = dataset.dims.map((voxels, axis) => voxels * ((spacing ?? dataset.spacing)[axis] ?? 1)) as Triple;
  return scale([x, y, z], 0.5 / Math.max(x, y, z));
}

/** How far the box reaches from its centre along a direction. */
function reach(normal: Triple, half: Triple): number {
  const [x, y, z] = normalize(normal);
  return dot([Math.abs(x), Math.abs(y), Math.abs(z)], half);
}

/** Share of the volume's extent along the normal that a plane cuts away, 0..1. */
export function cutShare(plane: ClipPlane, half: Triple): number {
  const most = reach(plane.normal, half);
  return clamp((plane.offset + most) / (2 * most), 0, 1);
}

/** The plane moved so that it cuts away this share. */
export function withCut(plane: ClipPlane, share: number, half: Triple): ClipPlane {
  return { ...plane, offset: rounded((2 * share - 1) * reach(plane.normal, half), 5) };
}

/** A plane that cuts away the half that is nearer to the eye. */
export function planeFacing(camera: Camera): ClipPlane {
  const [x, y, z] = frameOf(camera).back;
  // Adding 0 makes a negative zero positive.
  return { normal: [rounded(-x, 5) + 0, rounded(-y, 5) + 0, rounded(-z, 5) + 0], offset: 0 };
}

/** Keeps what was cut away, and the other way round. */
export const flipped = ({ normal, offset }: ClipPlane): ClipPlane =>
  ({ normal: [0 - normal[0], 0 - normal[1], 0 - normal[2]], offset: 0 - offset });
