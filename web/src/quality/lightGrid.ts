/** How method `convection_diffusion` carries and spreads light, in words. */

import type { Diffusion, Illumination, LightTransport, SceneFile } from "../generated/proto";

export const transports: readonly { value: LightTransport; label: string }[] = [
  { value: "characteristics", label: "Along lines of light" },
  { value: "upwind", label: "From cell to cell" },
  { value: "explicit", label: "In steps, as published" },
];

export const diffusions: readonly { value: Diffusion; label: string }[] = [
  { value: "p1", label: "As in thick matter" },
  { value: "heat", label: "Like heat, as published" },
  { value: "none", label: "None" },
];

/** Whether the scene's light is kept on a light grid: other modes show data, or single places. */
export const hasLightGrid = ({ illumination, rendering }: Pick<SceneFile, "illumination" | "rendering">): boolean => illumination.method === "convection_diffusion" && rendering.mode === "volume";

/** Why the chosen diffusion does nothing, in words; null if it does. */
export function whyNotDiffused({ diffusion }: Pick<Illumination, "diffusion">, scatteredOnce: boolean): string | null {
  if (diffusion === "none" || !scatteredOnce) return null;
  return "Light is scattered once, so nothing is diffused.";
}
