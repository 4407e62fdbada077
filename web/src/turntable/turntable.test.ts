import { describe, expect, it } from "vitest";
import type { Camera } from "../generated/proto";
import { framesOf, inWords, isUnderWay, progressInWords, refusal, requestOf, suggested, timeInWords, turned } from "./turntable";

const camera: Camera = { position: [3, 1, 0], target: [0, 1, 0], up: [0, 0, 2], fov_y_degrees: 40 };
const settings = suggested({ width: 1920, height: 1080 }, 8);

describe("a turntable", () => {
  it("suggests the viewport's shape, no larger than is quick", () => {
    expect(settings).toEqual({ turns: 1, seconds: 6, framesPerSecond: 24, width: 960, height: 540, samples: 8, format: "apng" });
    expect(suggested({ width: 300, height: 200 }, 100_000)).toMatchObject({ width: 300, height: 200, samples: 4096 });
  });

  it("says what will be drawn, and what would be refused", () => {
    expect(framesOf(settings)).toBe(144);
    expect(inWords(settings)).toBe("144 pictures of 960 × 540, one every 2.5°");
    expect(refusal(settings)).toBeNull();
    expect(refusal({ ...settings, seconds: 0.04 })).toMatch(/one picture/);
    expect(refusal({ ...settings, seconds: 100 })).toMatch(/2400 pictures/);
    expect(refusal({ ...settings, turns: 0 })).toMatch(/the same/);
  });

  it("turns the camera about its upright axis as the service does", () => {
    const quarter = turned(camera, 0.25);
    [0, 4, 0].forEach((x, axis) => expect(quarter.position[axis]).toBeCloseTo(x, 12));
    expect(quarter.target).toEqual(camera.target);
    [3, 1, 0].forEach((x, axis) => expect(turned(camera, 1).position[axis]).toBeCloseTo(x, 12));
    expect(turned(camera, -0.25).position[1]).toBeCloseTo(-2, 12);
  });

  it("asks for what was chosen", () => {
    expect(requestOf({ ...settings, turns: -2, format: "zip" }, camera)).toEqual({ turns: -2, frames: 144, frames_per_second: 24, width: 960, height: 540, samples: 8, format: "zip", camera });
  });

  it("tells how far it has come", () => {
    expect([0.2, 45, 89, 100, 3600, 9000].map(timeInWords)).toEqual(["1 s", "45 s", "89 s", "2 min", "60 min", "2.5 h"]);
    expect(progressInWords({ state: "drawing", frames: 9, frames_done: 0 })).toBe("0 of 9 pictures");
    expect(progressInWords({ state: "drawing", frames: 9, frames_done: 4, seconds_left: 12.3 })).toBe("4 of 9 pictures, about 12 s left");
    expect(progressInWords({ state: "waiting", frames: 9, frames_done: 0 })).toMatch(/Waiting/);
    expect([null, { state: "waiting" } as const, { state: "drawing" } as const, { state: "done" } as const].map(isUnderWay)).toEqual([false, true, true, false]);
  });
});
