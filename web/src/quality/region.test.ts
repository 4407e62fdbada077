import { describe, expect, it } from "vitest";
import type { Camera } from "../generated/proto";
import { regionInView } from "./region";

const camera = (target: [number, number, number], height: number): Camera =>
  ({ position: [target[0], target[1], target[2] + 2], target, up: [0, 1, 0], orthographic_height: height });

describe("region in view", () => {
  it("is the clip box where there is one", () => {
    const box: [[number, number, number], [number, number, number]] = [[0.1, 0, 0.25], [0.5, 1, 0.75]];
    expect(regionInView(camera([0, 0, 0], 1), { box }, [0.5, 0.5, 0.5])).toEqual(box);
  });

  it("is what lies around the pivot without one", () => {
    expect(regionInView(camera([0.25, 0, 0], 0.2), {}, [0.5, 0.25, 0.5])).toEqual([[0.65, 0.3, 0.4], [0.85, 0.7, 0.6]]);
  });

  it("stays in the volume and never vanishes", () => {
    expect(regionInView(camera([0, 0, 0], 5), {}, [0.5, 0.5, 0.5])).toEqual([[0, 0, 0], [1, 1, 1]]);
    const [low, high] = regionInView(camera([3, -3, 0], 0.1), {}, [0.5, 0.5, 0.5]);
    for (const axis of [0, 1, 2] as const) {
      expect(low[axis]).toBeGreaterThanOrEqual(0);
      expect(high[axis]).toBeLessThanOrEqual(1);
      expect(high[axis] - low[axis]).toBeGreaterThan(0.004);
    }
  });
});
