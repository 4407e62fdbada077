import { describe, expect, it } from "vitest";
import type { Camera } from "../generated/proto";
import { dot, length, sub, type Triple } from "../scene/vec";
import {
  frameOf, fromView, heightAtPivot, lookFrom, nearestAxis, orbit, pan, project, recentre, toOrthographic,
  toPerspective, toView, zoom, forAspect,
} from "./camera";
import { scaleBar, unitsPerWorld } from "./scaleBar";
import { standardViews } from "./views";

const start: Camera = { position: [0, 0, 2.5], target: [0, 0, 0], up: [0, 1, 0], fov_y_degrees: 40 };
const pole: Triple = [0, 1, 0];

function expectNear(a: Triple, b: Triple, tolerance = 1e-9): void {
  expect(length(sub(a, b))).toBeLessThan(tolerance);
}

describe("orbit", () => {
  it("keeps distance, pivot and an upright picture", () => {
    const turned = orbit(start, 0.7, 0.4, pole);
    expect(frameOf(turned).distance).toBeCloseTo(2.5, 12);
    expectNear(turned.target, start.target);
    expect(dot(frameOf(turned).right, pole)).toBeCloseTo(0, 12);
    expect(dot(frameOf(turned).up, frameOf(turned).back)).toBeCloseTo(0, 12);
  });

  it("moves what is near with the pointer: right and down", () => {
    const near: Triple = [0, 0, 0.5];
    const [x] = project(orbit(start, 0.2, 0, pole), near) ?? [0, 0];
    expect(x).toBeGreaterThan(0.01);
    const [, y] = project(orbit(start, 0, 0.2, pole), near) ?? [0, 0];
    expect(y).toBeLessThan(-0.01);
  });

  it("stops at the poles and comes back", () => {
    const above = orbit(start, 0, 10, pole);
    expect(dot(frameOf(above).back, pole)).toBeCloseTo(1, 5);
    const back = orbit(above, 0, -Math.PI / 2 + 1e-3, pole);
    expectNear(back.position, start.position, 1e-6);
  });

  it("leaves a straight view from above in either direction", () => {
    const top = standardViews(true)[4];
    if (!top) throw new Error("no top view");
    const camera = lookFrom(start, top.from, top.up);
    const tilted = orbit(camera, 0, -0.5, [0, 0, 1]);
    expect(frameOf(tilted).distance).toBeCloseTo(2.5, 9);
    expect(Math.acos(dot(frameOf(tilted).back, [0, 0, 1]))).toBeCloseTo(0.5, 2);
  });
});

describe("pan and zoom", () => {
  it("pans what lies at the pivot's depth by exactly the pointer's way", () => {
    const moved = pan(start, 0.1, 0.05);
    const [x, y] = project(moved, [0, 0, 0]) ?? [NaN, NaN];
    expect(x).toBeCloseTo(0.1, 12);
    expect(y).toBeCloseTo(-0.05, 12);
  });

  it.each([start, toOrthographic(start)])("keeps the point under the pointer while zooming", (camera) => {
    const height = heightAtPivot(camera);
    const held: Triple = [0.3 * height, -0.2 * height, 0];
    const zoomed = zoom(camera, 0.5, 0.3, -0.2);
    const [x, y] = project(zoomed, held) ?? [NaN, NaN];
    expect(x).toBeCloseTo(0.3, 9);
    expect(y).toBeCloseTo(-0.2, 9);
    expect(heightAtPivot(zoomed)).toBeCloseTo(height / 2, 9);
  });

  it("never passes through the pivot", () => {
    expect(frameOf(zoom(start, 1e-9, 0, 0)).distance).toBeGreaterThan(0.01);
  });

  it("recentres without turning", () => {
    const moved = recentre(pan(start, 0.4, 0.1), [0, 0, 0]);
    expectNear(moved.target, [0, 0, 0]);
    expectNear(frameOf(moved).back, frameOf(start).back);
  });
});

describe("projection", () => {
  it("changes between perspective and orthographic at the same size", () => {
    const flat = toOrthographic(start);
    expect(flat.fov_y_degrees).toBeUndefined();
    const back = toPerspective(flat, 40);
    expect(back.orthographic_height).toBeUndefined();
    expectNear(back.position, start.position, 1e-5);
  });

  it("turns directions into view axes and back", () => {
    const camera = orbit(start, 1.1, -0.3, pole);
    const direction: Triple = [0.2, -0.7, 0.4];
    expectNear(fromView(camera, toView(camera, direction)), direction);
  });

  it("hides what is behind the eye", () => {
    expect(project(start, [0, 0, 3])).toBeNull();
  });
});

describe("a narrow viewport", () => {
  const corners = [-0.5, 0.5].flatMap((x) => [-0.5, 0.5].flatMap((y) => [-0.5, 0.5].map((z): Triple => [x, y, z])));
  const overview: Camera = { ...start, position: [0, 0, 2.2] };

  it.each([0.4, 0.89, 1, 2])("shows the whole box at aspect %f", (aspect) => {
    for (const camera of [overview, toOrthographic(overview)].map((view) => forAspect(view, aspect))) {
      for (const corner of corners) {
        const [x, y] = project(camera, corner) ?? [NaN, NaN];
        expect(Math.abs(x)).toBeLessThan(aspect / 2);
        expect(Math.abs(y)).toBeLessThan(0.5);
      }
    }
  });

  it("leaves wide viewports as they are", () => {
    expect(forAspect(overview, 1.7)).toBe(overview);
    expect(forAspect(overview, NaN)).toBe(overview);
  });
});

describe("standard views", () => {
  it("shows the patient's left on the right from the front", () => {
    const front = standardViews(true)[0];
    if (!front) throw new Error("no front view");
    expectNear(frameOf(lookFrom(start, front.from, front.up)).right, [1, 0, 0]);
  });

  it("have perpendicular up directions", () => {
    for (const view of [...standardViews(true), ...standardViews(false)]) expect(dot(view.from, view.up)).toBe(0);
  });

  it("finds the turntable's axis", () => {
    expect(nearestAxis([0.1, -0.2, -0.9])).toEqual([0, 0, -1]);
  });
});

describe("scale bar", () => {
  it("is round and as long as it says", () => {
    const bar = scaleBar(start, 800, 240, "mm");
    const millimetresPerPixel = (heightAtPivot(start) * 240) / 800;
    expect(bar?.label).toBe("50 mm");
    expect((bar?.pixels ?? 0) * millimetresPerPixel).toBeCloseTo(50, 9);
  });

  it("needs a unit", () => {
    expect(unitsPerWorld(null, undefined)).toBeNull();
  });
});
