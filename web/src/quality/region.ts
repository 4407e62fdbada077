/** Which part of a volume is worth its full resolution. */

import type { Camera, Clip } from "../generated/proto";
import { clamp, rounded, type Triple } from "../scene/vec";
import { heightAtPivot } from "../viewport/camera";

/** Lower and upper corner in 0..1 volume coordinates. */
export type UnitBox = [Triple, Triple];

/** Thinnest region asked for, share of the edge. */
const MIN_EDGE = 0.005;

/** The clip box; without one the cube around the pivot that is as large as the picture is high there. */
export function regionInView(camera: Camera, clip: Pick<Clip, "box">, half: Triple): UnitBox {
  const { box } = clip;
  if (box) return fromSpans((axis) => [box[0][axis], box[1][axis]]);
  const reach = 0.5 * heightAtPivot(camera);
  return fromSpans((axis) => {
    const center = camera.target[axis] / (2 * half[axis]) + 0.5;
    const share = reach / (2 * half[axis]);
    return [center - share, center + share];
  });
}

function fromSpans(span: (axis: 0 | 1 | 2) => [number, number]): UnitBox {
  const spans = ([0, 1, 2] as const).map((axis) => {
    const [low, high] = span(axis).map((x) => clamp(x, 0, 1)) as [number, number];
    const start = clamp(low, 0, 1 - MIN_EDGE);
    return [rounded(start, 4), rounded(Math.max(high, start + MIN_EDGE), 4)] as const;
  });
  const corner = (end: 0 | 1) => spans.map((ends) => ends[end]) as unknown as Triple;
  return [corner(0), corner(1)];
}
