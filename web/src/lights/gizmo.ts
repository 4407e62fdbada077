/** Lights as lines in the world, and where their aim is held. */

import type { Light } from "../generated/proto";
import { add, cross, dot, length, normalize, scale, sub, type Triple } from "../scene/vec";
import { placeOf } from "./lights";

/** Corners of a drawn circle. */
const CIRCLE_CORNERS = 48;
/** Shortest aim, world units: what aims at its own place is drawn this long. */
const MIN_AIM = 0.15;

export interface Line {
  points: Triple[];
  closed: boolean;
}

/** Two directions across a third. */
function across(normal: Triple): [Triple, Triple] {
  const u = normalize(cross(Math.abs(normal[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0], normal));
  return [u, cross(normal, u)];
}

function circle(centre: Triple, [u, v]: readonly [Triple, Triple], radius: number): Line {
  const points = Array.from({ length: CIRCLE_CORNERS }, (_, i) => {
    const angle = (2 * Math.PI * i) / CIRCLE_CORNERS;
    return add(centre, add(scale(u, radius * Math.cos(angle)), scale(v, radius * Math.sin(angle))));
  });
  return { points, closed: true };
}

/** Direction in which a light shines; null where it has none. */
export function shinesTo(light: Light): Triple | null {
  switch (light.type) {
    case "spot": return normalize(light.direction);
    case "disk":
    case "rectangle": return normalize(light.normal);
    default: return null;
  }
}

/** Where the aim of a light is held: on its axis, as far away as the volume's centre. */
export function aimOf(light: Light): Triple | null {
  const [place, direction] = [placeOf(light), shinesTo(light)];
  if (!place || !direction) return null;
  return add(place, scale(direction, Math.max(MIN_AIM, dot(sub([0, 0, 0], place), direction), 0.5 * length(place))));
}

/** The light's shape. `facing` are the picture's axes to the right and upwards: a sphere is seen as a circle. */
export function outlineOf(light: Light, facing: readonly [Triple, Triple]): Line[] {
  const aim = aimOf(light);
  const place = placeOf(light);
  if (!place) return [];
  const axis: Line[] = aim ? [{ points: [place, aim], closed: false }] : [];
  switch (light.type) {
    case "sphere": return [circle(place, facing, light.radius)];
    case "disk": return [circle(place, across(normalize(light.normal)), light.radius), ...axis];
    case "rectangle": {
      const normal = normalize(light.normal);
      const right = normalize(cross(light.up, normal));
      const up = cross(normal, right);
      const corner = (x: number, y: number) => add(place, add(scale(right, (x * light.size[0]) / 2), scale(up, (y * light.size[1]) / 2)));
      return [{ points: [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)], closed: true }, ...axis];
    }
    case "spot": {
      if (!aim) return [];
      // Wider than a hemisphere there is no cone to draw.
      const angle = Math.min(light.cone_degrees[1], 80) * (Math.PI / 180);
      const ring = circle(aim, across(normalize(light.direction)), length(sub(aim, place)) * Math.tan(angle));
      const sides = [0, 1, 2, 3].map((quarter) => ({ points: [place, ring.points[(quarter * CIRCLE_CORNERS) / 4] ?? aim], closed: false }));
      return [ring, ...sides, ...axis];
    }
    default: return [];
  }
}
