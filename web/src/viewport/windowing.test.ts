import { describe, expect, it } from "vitest";
import { dragged } from "./windowing";

const middleOf = ([low, high]: readonly [number, number]) => (low + high) / 2;

describe("window and level", () => {
  it("stay where the pointer does", () => {
    expect(dragged([-100, 300], 0, 0, [-1000, 3000])).toEqual([-100, 300]);
  });

  it("across widens and narrows about the middle", () => {
    const wide = dragged([-100, 300], 0.5, 0, [-1000, 3000]);
    expect(wide[1] - wide[0]).toBeGreaterThan(1000);
    expect(middleOf(wide)).toBeCloseTo(100, 2);
    const back = dragged(wide, -0.5, 0, [-1000, 3000]);
    expect(back[0]).toBeCloseTo(-100, 1);
  });

  it("up raises the middle and keeps the width", () => {
    const up = dragged([0, 100], 0, 0.2, [0, 1000]);
    expect(up[1] - up[0]).toBeCloseTo(100, 9);
    expect(middleOf(up)).toBeCloseTo(80, 9);
  });

  it("stop at nothing and at far more than the data", () => {
    const narrow = dragged([0, 100], -50, 0, [0, 1000]);
    expect(narrow[1] - narrow[0]).toBeCloseTo(1, 6);
    const wide = dragged([0, 100], 50, 0, [0, 1000]);
    expect(wide[1] - wide[0]).toBeCloseTo(4000, 6);
    expect(middleOf(dragged([0, 100], 0, 99, [0, 1000]))).toBe(1000);
  });
});
