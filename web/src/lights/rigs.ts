/** Sets of lights, placed as seen by the viewer who asks for them. */

import type { Camera, Light } from "../generated/proto";
import { normalize, rounded, scale, type Triple } from "../scene/vec";
import { fromView } from "../viewport/camera";

export interface Rig {
  id: string;
  label: string;
  hint: string;
  lights: (camera: Camera) => Light[];
}

/** A directional light from `from` in view axes (x right, y up, z towards the viewer). */
function sun(camera: Camera, id: string, from: Triple, strength: number, tint: Triple = [1, 1, 1]): Light {
  const direction = scale(normalize(fromView(camera, from)), -1).map((x) => rounded(x, 5)) as Triple;
  return { type: "directional", id, enabled: true, direction, irradiance: scale(tint, strength) };
}

const ambient = (radiance: number, tint: Triple = [1, 1, 1]): Light =>
  ({ type: "environment", id: "ambient", enabled: true, radiance: scale(tint, radiance) });

const WARM: Triple = [1, 0.94, 0.85];
const COOL: Triple = [0.82, 0.9, 1];

export const rigs: readonly Rig[] = [
  {
    id: "three-point", label: "Three-point", hint: "Key from the upper left, soft fill from the right, rim from behind",
    lights: (camera) => [
      sun(camera, "key", [-0.8, 0.9, 1], 3, WARM), sun(camera, "fill", [1, 0.1, 0.7], 0.8, COOL), sun(camera, "rim", [0.5, 0.7, -1], 2.2), ambient(0.08),
    ],
  },
  {
    id: "rim", label: "Rim", hint: "From behind: edges glow, thin matter shines through",
    lights: (camera) => [sun(camera, "rim-left", [-1, 0.4, -0.8], 3.2, COOL), sun(camera, "rim-right", [1, 0.6, -0.8], 3.2, WARM), ambient(0.05)],
  },
  {
    id: "studio", label: "Studio", hint: "Large soft light from above, bright surroundings",
    lights: (camera) => {
      const towards = normalize(fromView(camera, [-0.4, 1, 0.6]));
      const center = scale(towards, 1.6).map((x) => rounded(x, 5)) as Triple;
      const normal = scale(towards, -1).map((x) => rounded(x, 5)) as Triple;
      return [{ type: "disk", id: "softbox", enabled: true, center, normal, radius: 0.7, radiance: [7, 7, 7] }, ambient(0.45)];
    },
  },
  {
    id: "flat", label: "Flat", hint: "Even light from everywhere, no shadows of note",
    lights: (camera) => [ambient(0.9), sun(camera, "front", [0, 0, 1], 0.6)],
  },
];
