import { describe, expect, it } from "vitest";
import { distance, middle, withEnd } from "./probing";

describe("a distance", () => {
  it("is in the dataset's unit", () => {
    // A scan 250 mm long on its longest edge.
    expect(distance([0.1, 0, 0], [0.1, 0.3, 0.4], 250)).toBeCloseTo(125, 9);
    expect(middle([0, 0, 0], [1, 2, -4])).toEqual([0.5, 1, -2]);
  });

  it("has two ends; a third click begins anew", () => {
    const one = withEnd([], [1, 0, 0]);
    const two = withEnd(one, [0, 1, 0]);
    expect(two).toEqual([[1, 0, 0], [0, 1, 0]]);
    expect(withEnd(two, [0, 0, 1])).toEqual([[0, 0, 1]]);
  });
});
