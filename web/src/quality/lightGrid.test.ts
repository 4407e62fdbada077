import { expect, test } from "vitest";
import { takesPictures } from "../lights/environments";
import { diffusions, hasLightGrid, transports, whyNotDiffused } from "./lightGrid";
import type { SceneFile } from "../generated/proto";

const scene = (method: string, mode: string) => ({ illumination: { method }, rendering: { mode } }) as unknown as SceneFile;

test("only pictures of matter in light by this method have a light grid", () => {
  expect(hasLightGrid(scene("convection_diffusion", "volume"))).toBe(true);
  expect(hasLightGrid(scene("convection_diffusion", "slice"))).toBe(false);
  expect(hasLightGrid(scene("local", "volume"))).toBe(false);
});

test("diffusion that does nothing says why", () => {
  expect(whyNotDiffused({ diffusion: "p1" }, false)).toBeNull();
  expect(whyNotDiffused({ diffusion: "none" }, true)).toBeNull();
  expect(whyNotDiffused({ diffusion: "heat" }, true)).toMatch(/once/);
});

test("every choice has a name of its own", () => {
  for (const choices of [diffusions, transports]) expect(new Set(choices.map(({ label }) => label)).size).toBe(choices.length);
});

test("the light grid takes pictures of light", () => {
  expect(takesPictures("convection_diffusion")).toBe(true);
});
