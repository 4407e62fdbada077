/** The illumination methods by what they give. */

import type { Light, Material, Method, SceneFile } from "../generated/proto";

export interface MethodChoice {
  method: Method;
  label: string;
  /** What it gives. */
  gives: string;
  /** Where it comes from. */
  paper: string;
}

export const methodChoices: readonly MethodChoice[] = [
  { method: "local", label: "Local", gives: "No shadows, instant", paper: "Shading by gradient and phase function" },
  { method: "convection_diffusion", label: "Convection-diffusion", gives: "Soft shadows and scattering on a grid", paper: "Zhang and Ma, Fast Global Illumination for Interactive Volume Visualization, 2013" },
  { method: "image_based", label: "Image-based", gives: "Shadows of every light, single scattering", paper: "Delalandre, Gautron and Marvie, Real-Time Image-Based Volume Lighting, 2013" },
  { method: "photon_map", label: "Photon map", gives: "Everything; follows edits", paper: "Jönsson, Kronander, Ropinski and Ynnerman, Historygrams, 2012" },
  { method: "precomputed_transfer", label: "Precomputed", gives: "Bake once, then sun and sky are free", paper: "Zhang, Dong and Ma, Precomputed Photon Mapping in Dynamic Lighting Environments, 2013" },
  { method: "path_traced", label: "Path traced", gives: "The truth, in time", paper: "Unbiased path tracing" },
];

export const labelOf = (method: Method): string => methodChoices.find((choice) => choice.method === method)?.label ?? method;

/** Whether paths make the picture: projections, slices and isosurfaces are cast by every method. */
export const isTraced = ({ illumination, rendering }: Pick<SceneFile, "illumination" | "rendering">): boolean => illumination.method === "path_traced" && rendering.mode === "volume";

/** Whether photons light the scene: other modes show data, or single places. */
export const hasPhotons = ({ illumination, rendering }: Pick<SceneFile, "illumination" | "rendering">): boolean => illumination.method === "photon_map" && rendering.mode === "volume";

/** Methods that approximate all of light: paths can refine their pictures. */
const refinable: readonly Method[] = ["photon_map", "convection_diffusion", "precomputed_transfer"];

/** Whether paths can refine the picture at rest. */
export const canBeRefined = ({ illumination, rendering }: Pick<SceneFile, "illumination" | "rendering">): boolean => refinable.includes(illumination.method) && rendering.mode === "volume";

/** Samples per pixel of a final picture: view rays, then paths that refine it. */
export function samplesAtRest(scene: SceneFile): number {
  if (isTraced(scene)) return scene.illumination.paths_per_pixel;
  const refining = scene.illumination.refine && canBeRefined(scene) ? scene.illumination.paths_per_pixel : 0;
  return scene.sampling.samples_per_pixel + refining;
}

/** What a control of the panels does not do with this method, in words; null if it works. */
export function withoutEffect(method: Method, control: "clip shadows" | "scattering orders"): string | null {
  if (method !== "local") return null;
  return {
    "clip shadows": "Local shading casts no shadows.",
    "scattering orders": "Local shading scatters light once and follows it no further.",
  }[control];
}

/** Lights that can be mixed afterwards; the server's limit. */
const MAX_MIXED_LIGHTS = 8;

/** Why lights cannot be mixed after rendering, in words; null if they can. Lights that are off count. */
export const whyNotMixed = (lights: readonly unknown[]): string | null => (lights.length > MAX_MIXED_LIGHTS ? `Only up to ${MAX_MIXED_LIGHTS} lights can be mixed; there are ${lights.length}.` : null);

/** The method that refuses lights with a place. */
export const OF_DISTANT_LIGHT: Method = "precomputed_transfer";

/** Whether a light shines from infinity. */
export const isDistant = ({ type }: Light): boolean => type === "directional" || type === "environment";

/** Mean cosine from which on six bands hold less than half of a phase function's peak. */
const NARROW = 0.85;

/** What of the scene its method does not show; null if nothing is left out. */
export function shortcoming({ illumination, lights, materials, transfer_function }: Pick<SceneFile, "illumination" | "lights" | "materials" | "transfer_function">): string | null {
  if (illumination.method === OF_DISTANT_LIGHT && !lights.some((light) => light.enabled && isDistant(light))) return "No distant light is on: add a directional one or an environment.";
  if (illumination.method === "photon_map" && illumination.gather === "field") {
    const scattersNarrowly = ({ phase }: Material) => (phase.type === "henyey_greenstein" && Math.abs(phase.g) >= NARROW) || (phase.type === "schlick" && Math.abs(phase.k) >= NARROW);
    const used = new Set(transfer_function.points.map(({ material }) => material));
    const narrow = Object.entries(materials).find(([name, material]) => used.has(name) && scattersNarrowly(material));
    if (narrow) return `Material ${narrow[0]} scatters more narrowly than the light field can tell: choose Gather: Photons under Quality.`;
  }
  const extended = lights.some((light) => light.enabled && ["rectangle", "disk", "sphere"].includes(light.type));
  return illumination.method === "image_based" && extended ? "Image-based lighting takes area lights from their centre: their shadows are sharp." : null;
}
