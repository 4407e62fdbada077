/** Standard views, with anatomical names where the data has them (LPS: x left, y posterior, z superior). */

import type { Camera, Dataset } from "../generated/proto";
import type { Triple } from "../scene/vec";
import { DEFAULT_FOV_DEGREES } from "./camera";

export interface StandardView {
  /** Short name; also the test id. */
  name: "front" | "back" | "left" | "right" | "top" | "bottom";
  /** What people read. */
  label: string;
  /** Letters on the orientation cube. */
  letter: string;
  /** Where the eye is, from the pivot. */
  from: Triple;
  up: Triple;
}

const anatomicalViews: readonly StandardView[] = [
  { name: "front", label: "Front (anterior)", letter: "A", from: [0, -1, 0], up: [0, 0, 1] },
  { name: "back", label: "Back (posterior)", letter: "P", from: [0, 1, 0], up: [0, 0, 1] },
  { name: "left", label: "Left", letter: "L", from: [1, 0, 0], up: [0, 0, 1] },
  { name: "right", label: "Right", letter: "R", from: [-1, 0, 0], up: [0, 0, 1] },
  { name: "top", label: "Top (superior)", letter: "S", from: [0, 0, 1], up: [0, -1, 0] },
  { name: "bottom", label: "Bottom (inferior)", letter: "I", from: [0, 0, -1], up: [0, -1, 0] },
];

const gridViews: readonly StandardView[] = [
  { name: "front", label: "Front (+z)", letter: "+Z", from: [0, 0, 1], up: [0, 1, 0] },
  { name: "back", label: "Back (−z)", letter: "−Z", from: [0, 0, -1], up: [0, 1, 0] },
  { name: "left", label: "Left (−x)", letter: "−X", from: [-1, 0, 0], up: [0, 1, 0] },
  { name: "right", label: "Right (+x)", letter: "+X", from: [1, 0, 0], up: [0, 1, 0] },
  { name: "top", label: "Top (+y)", letter: "+Y", from: [0, 1, 0], up: [0, 0, -1] },
  { name: "bottom", label: "Bottom (−y)", letter: "−Y", from: [0, -1, 0], up: [0, 0, 1] },
];

/** The six views in the order of the keys 1 to 6. */
export const standardViews = (anatomical: boolean): readonly StandardView[] =>
  anatomical ? anatomicalViews : gridViews;

/** The camera a scene without one starts with, until the server's is known. */
export function defaultCamera(dataset: Dataset | null): Camera {
  const common = { target: [0, 0, 0] as Triple, fov_y_degrees: DEFAULT_FOV_DEGREES };
  return dataset?.anatomical
    ? { ...common, position: [0, -2.5, 0], up: [0, 0, 1] }
    : { ...common, position: [0, 0, 2.5], up: [0, 1, 0] };
}
