import { describe, expect, it } from "vitest";
import type { Camera } from "../generated/proto";
import { dot, length, sub, type Triple } from "../scene/vec";
import { frameOf, toView } from "../viewport/camera";
import { isEdgeOn, isHounsfield, lookAtSlice, sliceAt, sliceAxis, slicePlace, sliceShare, tissueWindows } from "./rendering";

const half: Triple = [0.5, 0.25, 0.5];

describe("a slice", () => {
  it("knows the axis it lies across, however its normal is scaled or turned about", () => {
    expect(sliceAxis({ normal: [0, -3, 0], offset: 0.1 })).toBe(1);
    expect(sliceAxis({ normal: [0, 0, 1], offset: 0 })).toBe(2);
    expect(sliceAxis({ normal: [1, 1, 0], offset: 0 })).toBeNull();
  });

  it("is moved through the whole volume and no further", () => {
    const plane = { normal: [0, 1, 0] as Triple, offset: 0 };
    expect(sliceShare(plane, half)).toBe(0.5);
    expect(sliceAt(plane, 1, half).offset).toBeCloseTo(0.25, 9);
    expect(sliceShare({ ...plane, offset: -7 }, half)).toBe(0);
    for (const share of [0, 0.3, 1]) expect(sliceShare(sliceAt({ normal: [1, 2, 3], offset: 0 }, share, half), half)).toBeCloseTo(share, 4);
  });
});

describe("tissue windows", () => {
  it("are offered for data with air far below zero", () => {
    expect(isHounsfield({ value_range: [-1024, 2986] })).toBe(true);
    expect(isHounsfield({ value_range: [-500, 2986] })).toBe(false);
    expect(isHounsfield(null)).toBe(false);
    expect(tissueWindows.every(({ window: [low, high] }) => low < high)).toBe(true);
  });
});

describe("the view at a slice", () => {
  const camera: Camera = { position: [1, -2, 0.5], target: [0.1, 0, 0], up: [0, 0, 1], fov_y_degrees: 40 };
  const across = (normal: Triple) => ({ normal, offset: 0 });

  it.each<[string, Triple, Triple, Triple]>([
    // What is up and what is to the right in the picture (x left, y posterior, z superior).
    ["sagittal, from the left: head up, front to the left", [1, 0, 0], [0, 0, 1], [0, 1, 0]],
    ["coronal, from the front: head up, the patient's left to the right", [0, 1, 0], [0, 0, 1], [1, 0, 0]],
    ["axial, from the feet: front up, the patient's left to the right", [0, 0, 1], [0, -1, 0], [1, 0, 0]],
  ])("%s", (_, normal, up, right) => {
    const seen = lookAtSlice(across(normal), camera, true);
    expect(toView(seen, up)[1]).toBeCloseTo(1, 9);
    expect(toView(seen, right)[0]).toBeCloseTo(1, 9);
    expect(frameOf(seen).distance).toBeCloseTo(frameOf(camera).distance, 9);
    expect(length(sub(seen.target, camera.target))).toBe(0);
  });

  it("is from the positive side where there is no anatomy", () => {
    for (const normal of [[1, 0, 0], [0, 1, 0], [0, 0, -1]] as Triple[]) {
      const { back } = frameOf(lookAtSlice(across(normal), camera, false));
      expect(back.reduce((a, b) => a + b)).toBeCloseTo(1, 9);
      expect(Math.abs(dot(back, normal))).toBeCloseTo(1, 9);
    }
  });

  it("is from the nearer side of an oblique one", () => {
    const normal: Triple = [0.6, 0, 0.8];
    expect(dot(frameOf(lookAtSlice(across(normal), camera, true)).back, normal)).toBeCloseTo(1, 9);
    expect(dot(frameOf(lookAtSlice(across([-0.6, 0, -0.8]), camera, true)).back, normal)).toBeCloseTo(1, 9);
  });

  it("is known to be edge-on", () => {
    expect(isEdgeOn(across([0, 0, 4]), { ...camera, position: [0.1, -2, 0.1] })).toBe(true);
    expect(isEdgeOn(across([0, 0, 4]), { ...camera, position: [0.1, -2, 0.5] })).toBe(false);
  });
});

describe("the place of a slice", () => {
  const dataset = { dims: [100, 50, 20] as Triple, spacing: [1, 1, 2] as Triple };

  it("is a length from the first face, and the number of the slice", () => {
    expect(slicePlace({ normal: [0, 0, 1], offset: 0 }, dataset, undefined)).toEqual({ length: 20, slice: { number: 11, count: 20 } });
    expect(slicePlace({ normal: [1, 0, 0], offset: -0.5 }, dataset, undefined)).toEqual({ length: 0, slice: { number: 1, count: 100 } });
    expect(slicePlace({ normal: [0, 2, 0], offset: 9 }, dataset, undefined)).toEqual({ length: 50, slice: { number: 50, count: 50 } });
  });

  it("counts along the axis, whichever way the normal points", () => {
    const place = slicePlace({ normal: [-1, 0, 0], offset: 0.395 }, dataset, undefined);
    expect(place.length).toBeCloseTo(10.5, 9);
    expect(place.slice).toEqual({ number: 11, count: 100 });
  });

  it("has no number where the slice is oblique", () => {
    const place = slicePlace({ normal: [1, 1, 0], offset: 0 }, dataset, undefined);
    expect(place.slice).toBeNull();
    expect(place.length).toBeCloseTo(75 / Math.SQRT2, 6);
  });
});
