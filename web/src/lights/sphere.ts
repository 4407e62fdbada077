/**
 * The small sphere a light's direction is dragged on. Its visible half holds the directions towards
 * the viewer; beyond its rim, up to twice the radius, lie those from behind.
 */

import { clamp, normalize, rotate, type Triple } from "../scene/vec";

/** Direction (view axes, towards the light) of a place on the sphere; radius 1, y upwards. */
export function directionAt(x: number, y: number): Triple {
  const radius = Math.hypot(x, y);
  if (radius <= 1) return [x, y, Math.sqrt(1 - radius * radius)];
  const behind = clamp(2 - radius, 0, 1);
  const k = behind / radius;
  return [x * k, y * k, -Math.sqrt(1 - behind * behind)];
}

/** Place of a direction on the sphere; the inverse of `directionAt`. */
export function placeAt([x, y, z]: Triple): [number, number] {
  const radius = Math.hypot(x, y);
  if (z >= 0 || radius < 1e-9) return z >= 0 ? [x, y] : [0, 2];
  const k = (2 - radius) / radius;
  return [x * k, y * k];
}

/** Stops this close to straight up and down, degrees. */
const POLE_MARGIN = 1;
const RADIANS = Math.PI / 180;

/** The direction turned to the right about the vertical of the picture, and upwards; degrees. */
export function turned(towards: Triple, right: number, up: number): Triple {
  const sideways = rotate(towards, [0, 1, 0], right * RADIANS);
  const height = Math.asin(clamp(sideways[1], -1, 1)) / RADIANS;
  const to = clamp(height + up, POLE_MARGIN - 90, 90 - POLE_MARGIN);
  const axis = normalize([-sideways[2], 0, sideways[0]], [-1, 0, 0]);
  return rotate(sideways, axis, (to - height) * RADIANS);
}

/** Where the light comes from, as one would say it. */
export function directionInWords([x, y, z]: Triple): string {
  const part = (amount: number, positive: string, negative: string) => (Math.abs(amount) < 0.2 ? [] : [amount > 0 ? positive : negative]);
  return `from ${[...part(y, "above", "below"), ...part(x, "the right", "the left"), ...part(z, "in front", "behind")].join(", ")}`;
}
