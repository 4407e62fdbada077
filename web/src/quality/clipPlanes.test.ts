import { describe, expect, it } from "vitest";
import type { Camera, ClipPlane } from "../generated/proto";
import { dot, type Triple } from "../scene/vec";
import { cutShare, flipped, halfEdges, planeFacing, withCut } from "./clipPlanes";
import { withoutEffect } from "./methods";

const half: Triple = [0.5, 0.25, 0.5];
const kept = ({ normal, offset }: ClipPlane, point: Triple): boolean => dot(normal, point) >= offset;

describe("a clip plane", () => {
  const camera: Camera = { position: [0, 0, 2], target: [0, 0, 0], up: [0, 1, 0], fov_y_degrees: 40 };

  it("cuts away what is nearer to the viewer", () => {
    const plane = planeFacing(camera);
    expect(plane).toEqual({ normal: [0, 0, -1], offset: 0 });
    expect(kept(plane, [0, 0, 0.3])).toBe(false);
    expect(kept(plane, [0, 0, -0.3])).toBe(true);
    expect(kept(flipped(plane), [0, 0, 0.3])).toBe(true);
  });

  it("is moved by the share it cuts away", () => {
    const up: ClipPlane = { normal: [0, 2, 0], offset: 0 };
    expect(cutShare(up, half)).toBe(0.5);
    expect(withCut(up, 0.75, half).offset).toBeCloseTo(0.125, 9);
    for (const share of [0, 0.2, 1]) expect(cutShare(withCut({ normal: [1, 1, 0], offset: 0 }, share, half), half)).toBeCloseTo(share, 4);
    expect(cutShare({ normal: [1, 0, 0], offset: 9 }, half)).toBe(1);
  });

  it("knows the box of the volume", () => {
    expect(halfEdges({ dims: [100, 50, 25], spacing: [1, 1, 4] }, undefined)).toEqual([0.5, 0.25, 0.5]);
    expect(halfEdges({ dims: [100, 50, 25], spacing: [1, 1, 4] }, [1, 1, 1])).toEqual([0.5, 0.25, 0.125]);
  });
});

describe("controls without effect", () => {
  it("are told for the method that lacks them alone", () => {
    expect(withoutEffect("local", "clip shadows")).toContain("no shadows");
    expect(withoutEffect("photon_map", "clip shadows")).toBeNull();
  });
});
