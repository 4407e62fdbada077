/**
 * The small sphere a light's direction is dragged on. Its visible half holds the directions towards
 * the viewer; beyond its rim, up to twice the radius, lie those from behind.
 */

import { clamp, type Triple } from "../scene/vec";

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
