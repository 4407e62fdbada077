/** Three numbers: a point, a direction or a linear colour. */
export type Triple = [number, number, number];

/** Smallest length a vector may have to be a direction. */
const MIN_LENGTH = 1e-12;

export const add = (a: Triple, b: Triple): Triple => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: Triple, b: Triple): Triple => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a: Triple, k: number): Triple => [a[0] * k, a[1] * k, a[2] * k];
export const dot = (a: Triple, b: Triple): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a: Triple): number => Math.hypot(a[0], a[1], a[2]);

export const cross = (a: Triple, b: Triple): Triple => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** Unit vector along `a`; `fallback` where `a` has no direction. */
export function normalize(a: Triple, fallback: Triple = [0, 0, 1]): Triple {
  const norm = length(a);
  return norm > MIN_LENGTH ? scale(a, 1 / norm) : fallback;
}

/** `a` turned about the unit vector `axis` by `angle` radians, right-handed (Rodrigues). */
export function rotate(a: Triple, axis: Triple, angle: number): Triple {
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  return add(add(scale(a, c), scale(cross(axis, a), s)), scale(axis, dot(axis, a) * (1 - c)));
}

export const lerp = (a: number, b: number, t: number): number => a + (b - a) * t;

export const lerpTriple = (a: Triple, b: Triple, t: number): Triple => [
  lerp(a[0], b[0], t),
  lerp(a[1], b[1], t),
  lerp(a[2], b[2], t),
];

export const clamp = (x: number, low: number, high: number): number =>
  Math.min(high, Math.max(low, x));

/** `x` with at most `digits` significant digits: keeps patches and files readable. */
export const rounded = (x: number, digits = 6): number => Number(x.toPrecision(digits));
