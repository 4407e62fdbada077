import { describe, expect, it } from "vitest";
import type { Camera } from "../generated/proto";
import { filmFrames, filmInWords, filmRefusal, filmRequest, filmSeconds, keysOf, movedView, withoutView, withSeconds, withView, type SavedView } from "./film";
import { suggested } from "./turntable";

const at = (x: number): Camera => ({ position: [x, 1, 0], target: [0, 1, 0], up: [0, 0, 1], fov_y_degrees: 40 });
const settings = { ...suggested({ width: 640, height: 480 }, 4), framesPerSecond: 10 };
const three = [at(1), at(2), at(3)].reduce<SavedView[]>(withView, []);
const xs = (views: readonly SavedView[]): number[] => views.map(({ camera }) => camera.position[0]);

describe("a film", () => {
  it("keeps views in order, and lets them be moved and removed", () => {
    expect(xs(three)).toEqual([1, 2, 3]);
    expect(new Set(three.map(({ id }) => id)).size).toBe(3);
    const [first, , last] = three as [SavedView, SavedView, SavedView];
    expect(xs(movedView(three, last.id, -1))).toEqual([1, 3, 2]);
    expect(xs(movedView(three, first.id, -1))).toEqual([1, 2, 3]);
    expect(xs(movedView(three, first.id, 9))).toEqual([2, 3, 1]);
    const fewer = withoutView(three, first.id);
    expect(xs(fewer)).toEqual([2, 3]);
    expect(xs(withView(fewer, at(4)))).toEqual([2, 3, 4]);
    expect(new Set(withView(fewer, at(4)).map(({ id }) => id)).size).toBe(3);
  });

  it("counts time from the first view, whatever that one kept", () => {
    const [first, second] = three as [SavedView, SavedView];
    const views = withSeconds(withSeconds(three, second.id, 0.5), first.id, 99);
    expect(keysOf(views).map(({ seconds }) => seconds)).toEqual([0, 0.5, 2.5]);
    expect(filmSeconds(views)).toBe(2.5);
    expect(filmFrames(views, settings)).toBe(26);
    expect(filmInWords(views, settings)).toBe("26 pictures of 640 × 480 in 2.5 s");
  });

  it("says what would be refused", () => {
    expect(filmRefusal(three, settings)).toBeNull();
    expect(filmRefusal(three.slice(0, 1), settings)).toMatch(/two views/);
    expect(filmRefusal(withSeconds(three, 2, 600), settings)).toMatch(/6021 pictures/);
    const { position, target, up } = at(4);
    expect(filmRefusal(withView(three, { position, target, up, orthographic_height: 1 }), settings)).toMatch(/View 4 is without/);
    const many = Array.from({ length: 65 }, (_, x) => at(x + 1)).reduce<SavedView[]>(withView, []);
    expect(filmRefusal(many, settings)).toMatch(/64/);
  });

  it("asks for its views and for no turns", () => {
    const request = filmRequest(three, settings);
    expect(request).toEqual({ keys: keysOf(three), frames: 41, frames_per_second: 10, width: 640, height: 480, samples: 4, format: "apng" });
  });
});
