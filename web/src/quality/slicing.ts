/** From slice to slice by keys. */

import { session } from "../session/engine";
import { useSession } from "../session/store";
import { clamp } from "../scene/vec";
import { halfEdges } from "./clipPlanes";
import { sliceAt, slicePlace, sliceShare } from "./rendering";

/** Steps of an oblique slice through the volume. */
const OBLIQUE_STEPS = 200;

/** Goes on by so many slices, where a slice is shown. */
export function stepSlice(by: number): void {
  const { scene, dataset } = useSession.getState();
  if (!scene || !dataset || scene.rendering.mode !== "slice") return;
  const { slice } = scene.rendering;
  const half = halfEdges(dataset, scene.spacing);
  const count = slicePlace(slice, dataset, scene.spacing).slice?.count ?? OBLIQUE_STEPS;
  // Through the middles of the slices, where the values are those of the data.
  const at = Math.floor(sliceShare(slice, half) * count + 1e-6);
  const next = (clamp(at + by, 0, count - 1) + 0.5) / count;
  session.edit({ rendering: { slice: sliceAt(slice, next, half) } }, "slice-step");
}
