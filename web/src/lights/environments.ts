/**
 * Environment lights: one colour from everywhere, or a picture of light. Which methods draw pictures,
 * and how a picture is turned about the scene's upright axis.
 *
 * A picture's upper edge is +y of its own axes; data with anatomical axes stands upright along +z,
 * so pictures are stood up there before they are turned (`rotation_degrees` is about x, y, z in order).
 */

import type { Camera, Environment, Light, Method, SceneFile } from "../generated/proto";
import { isDistant, OF_DISTANT_LIGHT } from "../quality/methods";
import type { Patch } from "../scene/mergePatch";
import { rounded, scale, sub, type Triple } from "../scene/vec";
import { withIds } from "./lights";

export type EnvironmentLight = Extract<Light, { type: "environment" }>;

/** Methods that refuse pictures, and the one that draws them instead. */
const WITHOUT_PICTURES: readonly Method[] = ["local"];
const WITH_PICTURES: Method = "path_traced";

/** Radiance in place of a picture whose own is not known: it is gone, or the list has not arrived. */
const UNKNOWN_RADIANCE: Triple = [0.5, 0.5, 0.5];
/** Stands a picture of a scene with anatomical axes upright: its +y becomes the world's +z. */
const STAND_UP_DEGREES = 90;

type Lit = Pick<SceneFile, "illumination" | "lights">;

export const pictureOf = (light: Light): string | null => (light.type === "environment" ? (light.image ?? null) : null);

/** The picture that lights a scene; null if none does. */
export const pictureOfScene = ({ lights }: Pick<SceneFile, "lights">): string | null => lights.map(pictureOf).find((image) => image !== null) ?? null;

export const takesPictures = (method: Method): boolean => !WITHOUT_PICTURES.includes(method);

/** What an environment light has whatever it shows. */
const common = ({ type, id, enabled }: EnvironmentLight): EnvironmentLight => ({ type, enabled, ...(id === undefined ? {} : { id }) });

/** The light with a picture. From a uniform one it starts upright, not turned, and as bright as it was stored. */
export function withPicture(light: EnvironmentLight, image: string, anatomical: boolean): EnvironmentLight {
  if (light.image !== undefined) return { ...light, image };
  return { ...common(light), image, scale: 1, ...(anatomical ? { rotation_degrees: [STAND_UP_DEGREES, 0, 0] as Triple } : {}) };
}

/** The mean radiance over all directions of a picture at scale 1. */
export const meanRadiance = (pictures: readonly Pick<Environment, "id" | "mean_radiance">[] | null, image: string | undefined): Triple =>
  pictures?.find(({ id }) => id === image)?.mean_radiance ?? UNKNOWN_RADIANCE;

/** The light without its picture: as much light in all and of the same colour, from everywhere alike. */
export const withoutPicture = (light: EnvironmentLight, mean: Triple): EnvironmentLight =>
  light.image === undefined ? light : { ...common(light), radiance: scale(mean, light.scale ?? 1).map((channel) => rounded(channel, 3)) as Triple };

/** A picture for light `index`; a method that refuses pictures gives way in the same edit. */
export function choosePicture({ illumination, lights }: Lit, index: number, image: string, anatomical: boolean): { patch: Patch; switched: boolean } {
  const switched = !takesPictures(illumination.method);
  const chosen = withIds(lights).map((light, i) => (i === index && light.type === "environment" ? withPicture(light, image, anatomical) : light));
  return { switched, patch: { lights: chosen, ...(switched ? { illumination: { method: WITH_PICTURES } } : {}) } };
}

const refuses = (method: Method, light: Light): boolean => light.enabled && method === OF_DISTANT_LIGHT && !isDistant(light);

/** Another method. In the same edit one that refuses pictures takes them off the lights, and lights that it refuses are switched off. */
export function chooseMethod(scene: Lit, method: Method, mean: (image: string | undefined) => Triple): { patch: Patch; tookPicture: boolean; switchedOff: number } {
  const illumination = { method };
  const tookPicture = !takesPictures(method) && pictureOfScene(scene) !== null;
  const switchedOff = scene.lights.filter((light) => refuses(method, light)).length;
  if (!tookPicture && switchedOff === 0) return { patch: { illumination }, tookPicture, switchedOff };
  const lights = withIds(scene.lights).map((light) => {
    if (refuses(method, light)) return { ...light, enabled: false };
    return tookPicture && light.type === "environment" ? withoutPicture(light, mean(light.image)) : light;
  });
  return { patch: { illumination, lights }, tookPicture, switchedOff };
}

/** Degrees brought to -180 (left out) to 180. */
export function wrapped(degrees: number): number {
  const turn = ((degrees % 360) + 360) % 360;
  return turn > 180 ? turn - 360 : turn;
}

const uprightIndex = (anatomical: boolean): 1 | 2 => (anatomical ? 2 : 1);

/**
 * How far the picture is turned to the right as a viewer inside it sees it, degrees. Right-handed
 * turns about the upright axis go to the left.
 */
export const turnOf = (light: EnvironmentLight, anatomical: boolean): number => wrapped(-(light.rotation_degrees ?? [0, 0, 0])[uprightIndex(anatomical)]);

/** The light turned to the right by this much in all. */
export function withTurn(light: EnvironmentLight, degrees: number, anatomical: boolean): EnvironmentLight {
  const rotation: Triple = [...(light.rotation_degrees ?? [0, 0, 0])];
  rotation[uprightIndex(anatomical)] = Math.round(wrapped(-degrees) * 100) / 100;
  return { ...light, rotation_degrees: rotation };
}

/**
 * The column of the picture, 0..1 from its left edge, that lies straight behind the volume for this
 * camera. A camera that looks along the upright axis has what its upper edge points at.
 */
export function columnBehind(light: EnvironmentLight, camera: Camera, anatomical: boolean): number {
  const across = ([x, y, z]: Triple): [number, number] => (anatomical ? [x, y] : [x, -z]);
  const view = sub(camera.target, camera.position);
  let [right, ahead] = across(view);
  // Steeper than about 84 degrees: sideways hardly anything is left of the direction.
  if (Math.hypot(right, ahead) < 0.1 * Math.hypot(...view)) {
    const down = view[uprightIndex(anatomical)] < 0;
    [right, ahead] = across(down ? camera.up : scale(camera.up, -1));
  }
  const degrees = Math.atan2(right, ahead) * (180 / Math.PI) - turnOf(light, anatomical);
  return (((degrees / 360) % 1) + 1) % 1;
}
