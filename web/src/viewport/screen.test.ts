import { describe, expect, it } from "vitest";
import type { Camera } from "../generated/proto";
import { add, scale, type Triple } from "../scene/vec";
import { toOrthographic } from "./camera";
import { along, inPicture, isInside, pathThrough, seenAt } from "./screen";

const viewport = { width: 800, height: 400 };
const perspective: Camera = { position: [0.3, -2, 0.5], target: [0, 0, 0.1], up: [0, 0, 1], fov_y_degrees: 40 };

describe.each([["perspective", perspective], ["orthographic", toOrthographic(perspective)]])("%s", (_, camera) => {
  it("sees the pivot in the middle", () => {
    const at = seenAt(camera, viewport, camera.target);
    expect(at?.x).toBeCloseTo(400, 6);
    expect(at?.y).toBeCloseTo(200, 6);
    expect(at && isInside(at, viewport)).toBe(true);
    expect(isInside({ x: -1, y: 5 }, viewport)).toBe(false);
  });

  it("moves a point parallel to the picture under the pointer, at any depth", () => {
    for (const point of [[0, 0, 0], [0.2, -1, 0.3], [0, 1, 0]] as Triple[]) {
      const from = seenAt(camera, viewport, point);
      const to = seenAt(camera, viewport, add(point, inPicture(camera, viewport, point, 30, -12)));
      expect((to?.x ?? NaN) - (from?.x ?? NaN)).toBeCloseTo(30, 6);
      expect((to?.y ?? NaN) - (from?.y ?? NaN)).toBeCloseTo(-12, 6);
    }
  });

  it("moves a point along a direction as the pointer goes that way", () => {
    const direction: Triple = [1, 0, 0];
    const point: Triple = [0.1, 0.1, 0.1];
    const goal = add(point, scale(direction, 0.02));
    const [from, to] = [seenAt(camera, viewport, point), seenAt(camera, viewport, goal)];
    if (!from || !to) throw new Error("both are seen");
    expect(along(camera, viewport, point, direction, to.x - from.x, to.y - from.y)).toBeCloseTo(0.02, 3);
  });

  it("has upwards for a direction towards the viewer", () => {
    const direction = scale([camera.position[0], camera.position[1], camera.position[2] - 0.1], 1 / Math.hypot(0.3, 2, 0.4));
    expect(along(camera, viewport, camera.target, direction, 0, -10)).toBeGreaterThan(0);
  });
});

it("draws lines without what lies behind the eye", () => {
  const eye: Triple = perspective.position;
  const path = pathThrough(perspective, viewport, [[0, 0, 0], add(eye, [0, -1, 0]), [0.1, 0, 0]], false);
  expect(path.match(/M/g)).toHaveLength(2);
  expect(pathThrough(perspective, viewport, [[0, 0, 0], [0.1, 0, 0], [0, 0, 0.1]], true).match(/L/g)).toHaveLength(3);
});
