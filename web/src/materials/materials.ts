/** Materials: how matter scatters. Changing a type keeps what the new one has in common. */

import type { Brdf, Material, Phase } from "../generated/proto";

export const phaseNames: Record<Phase["type"], string> = {
  isotropic: "Isotropic",
  henyey_greenstein: "Henyey-Greenstein",
  schlick: "Schlick",
};

export const brdfNames: Record<Brdf["type"], string> = {
  lambert: "Lambert",
  blinn_phong: "Blinn-Phong",
  ashikhmin_shirley: "Ashikhmin-Shirley",
  abc: "ABC",
};

/** Most asymmetry a phase function may have. */
export const MAX_ASYMMETRY = 0.999;

export const asymmetryOf = (phase: Phase): number => (phase.type === "henyey_greenstein" ? phase.g : phase.type === "schlick" ? phase.k : 0);

export function phaseOf(type: Phase["type"], asymmetry: number): Phase {
  switch (type) {
    case "isotropic": return { type };
    case "henyey_greenstein": return { type, g: asymmetry };
    case "schlick": return { type, k: asymmetry };
  }
}

export function brdfOf(type: Brdf["type"], diffuse: number): Brdf {
  switch (type) {
    case "lambert": return { type, diffuse };
    case "blinn_phong": return { type, diffuse, specular: 0.05, exponent: 40 };
    case "ashikhmin_shirley": return { type, diffuse, specular: 0.05, exponents: [100, 100] };
    case "abc": return { type, diffuse, a: 1, b: 20, c: 1 };
  }
}

/** The material with a weight of its surface; a surface needs a BRDF. */
export function withSurface(material: Material, surface: number): Material {
  return surface > 0 && !material.brdf ? { ...material, surface, brdf: brdfOf("blinn_phong", 0.8) } : { ...material, surface };
}

/** A name that is not taken. */
export function freeName(taken: readonly string[]): string {
  let number = 1;
  while (taken.includes(`material_${number}`)) number += 1;
  return `material_${number}`;
}
