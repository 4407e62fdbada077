/** Lights as one kind of thing: strength and colour, place and direction, whatever the type. */

import type { Light } from "../generated/proto";
import { hueOf, strengthOf, withStrength } from "../scene/colour";
import { add, length, normalize, rounded, scale, sub, type Triple } from "../scene/vec";

export type LightType = Light["type"];

export const lightNames: Record<LightType, string> = {
  directional: "Directional",
  point: "Point",
  spot: "Spot",
  rectangle: "Rectangle",
  disk: "Disk",
  sphere: "Sphere",
  environment: "Environment",
};

const WHITE: Triple = [1, 1, 1];
/** Distance from the centre at which new lights are placed, world units. */
const PLACE_DISTANCE = 1.4;

/** Radiometric quantity of a light, linear RGB. */
export function powerOf(light: Light): Triple {
  switch (light.type) {
    case "directional": return light.irradiance;
    case "point":
    case "spot": return light.intensity;
    case "rectangle":
    case "disk":
    case "sphere": return light.radiance;
    case "environment": return light.radiance ?? scale(WHITE, light.scale ?? 1);
  }
}

/** What the strength of a light measures. */
export function quantityOf(light: Light): string {
  switch (light.type) {
    case "directional": return "Irradiance on a perpendicular plane";
    case "point":
    case "spot": return "Radiant intensity: irradiance at distance 1";
    default: return "Radiance";
  }
}

function withPower(light: Light, power: Triple): Light {
  switch (light.type) {
    case "directional": return { ...light, irradiance: power };
    case "point":
    case "spot": return { ...light, intensity: power };
    case "rectangle":
    case "disk":
    case "sphere": return { ...light, radiance: power };
    case "environment": return light.image === undefined ? { ...light, radiance: power } : { ...light, scale: strengthOf(power) };
  }
}

export const lightStrength = (light: Light): number => strengthOf(powerOf(light));
export const setStrength = (light: Light, strength: number): Light => withPower(light, withStrength(powerOf(light), strength));
export const lightHue = (light: Light): Triple => hueOf(powerOf(light));

/** The colour as ratio of channels; the strength stays. */
export const setHue = (light: Light, hue: Triple): Light => withPower(light, withStrength(hue, lightStrength(light) || 1));

/** Where the light is; null for lights at infinity. */
export function placeOf(light: Light): Triple | null {
  switch (light.type) {
    case "point":
    case "spot": return light.position;
    case "rectangle":
    case "disk":
    case "sphere": return light.center;
    default: return null;
  }
}

export function setPlace(light: Light, place: Triple): Light {
  const at: Triple = [rounded(place[0], 5), rounded(place[1], 5), rounded(place[2], 5)];
  switch (light.type) {
    case "point":
    case "spot": return { ...light, position: at };
    case "rectangle":
    case "disk":
    case "sphere": return { ...light, center: at };
    default: return light;
  }
}

/** Unit vector from the volume's centre towards where the light comes from; null if from everywhere. */
export function towardsLight(light: Light): Triple | null {
  if (light.type === "environment") return null;
  if (light.type === "directional") return normalize(scale(light.direction, -1));
  return normalize(placeOf(light) ?? [0, 1, 0], [0, 1, 0]);
}

/** The light seen from the volume's centre in direction `towards`: same distance, aimed at the centre. */
export function comeFrom(light: Light, towards: Triple): Light {
  const direction = scale(normalize(towards), -1).map((x) => rounded(x, 5)) as Triple;
  if (light.type === "directional") return { ...light, direction };
  const place = placeOf(light);
  if (!place) return light;
  const moved = setPlace(light, scale(normalize(towards), length(place) || PLACE_DISTANCE));
  return aimAt(moved, [0, 0, 0]);
}

/** Turns what has a direction towards a point. */
export function aimAt(light: Light, target: Triple): Light {
  const place = placeOf(light);
  if (!place) return light;
  const direction = normalize(sub(target, place), [0, -1, 0]).map((x) => rounded(x, 5)) as Triple;
  switch (light.type) {
    case "spot": return { ...light, direction };
    case "disk": return { ...light, normal: direction };
    case "rectangle": return { ...light, normal: direction, up: upFor(direction) };
    default: return light;
  }
}

/** An up vector that is not parallel to `normal`. */
const upFor = (normal: Triple): Triple => (Math.abs(normal[1]) < 0.9 ? [0, 1, 0] : [0, 0, 1]);

/** A new light that shines at the centre from direction `towards`. */
export function newLight(type: LightType, towards: Triple, id: string): Light {
  const place = scale(normalize(towards), PLACE_DISTANCE);
  const common = { id, enabled: true };
  const make = (): Light => {
    switch (type) {
      case "directional": return { ...common, type, direction: [0, -1, 0], irradiance: [3, 3, 3] };
      case "point": return { ...common, type, position: place, intensity: [4, 4, 4] };
      case "spot": return { ...common, type, position: place, direction: [0, -1, 0], cone_degrees: [20, 32], intensity: [6, 6, 6] };
      case "rectangle": return { ...common, type, center: place, normal: [0, -1, 0], up: [0, 0, 1], size: [0.8, 0.8], radiance: [8, 8, 8] };
      case "disk": return { ...common, type, center: place, normal: [0, -1, 0], radius: 0.4, radiance: [8, 8, 8] };
      case "sphere": return { ...common, type, center: place, radius: 0.2, radiance: [20, 20, 20] };
      case "environment": return { ...common, type, radiance: [0.5, 0.5, 0.5] };
    }
  };
  return comeFrom(make(), towards);
}

/** An id that no other light has: the type and the first free number. */
export function freeId(lights: readonly Light[], type: LightType): string {
  const taken = new Set(lights.map((light, index) => light.id ?? String(index)));
  let number = 1;
  while (taken.has(`${type}-${number}`)) number += 1;
  return `${type}-${number}`;
}

/**
 * Every light with an id of its own. A light without one is known by its index, which changes when
 * another is removed; the name it had is written down before that.
 */
export const withIds = (lights: readonly Light[]): Light[] =>
  lights.map((light, index) => (light.id === undefined ? { ...light, id: String(index) } : light));

/** Moves the light parallel to the view, keeping its distance from the eye's plane. */
export const moveBy = (light: Light, by: Triple): Light => {
  const place = placeOf(light);
  return place ? setPlace(light, add(place, by)) : light;
};
