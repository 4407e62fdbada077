import { describe, expect, it } from "vitest";
import type { Triple } from "../scene/vec";
import { isHounsfield, sliceAt, sliceAxis, sliceShare, tissueWindows } from "./rendering";

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
