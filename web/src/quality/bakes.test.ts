import { expect, test } from "vitest";
import { takesPictures } from "../lights/environments";
import type { SceneFile } from "../generated/proto";
import { bakeCostInWords, clusterChoices, clusterChoicesWith, compressionInWords, directionChoices, hasBake, lightChoices } from "./bakes";

const scene = (method: string, mode: string) => ({ illumination: { method }, rendering: { mode } }) as unknown as SceneFile;

test("only pictures of matter in light by this method are baked", () => {
  expect(hasBake(scene("precomputed_transfer", "volume"))).toBe(true);
  expect(hasBake(scene("precomputed_transfer", "slice"))).toBe(false);
  expect(hasBake(scene("photon_map", "volume"))).toBe(false);
});

test("choices are what the server takes, by names of their own", () => {
  expect(lightChoices.map(({ value }) => Number(value))).toEqual([42, 162, 642]);
  expect(directionChoices.map(({ value }) => Number(value))).toEqual([48, 192, 768, 3072]);
  expect(clusterChoices.map(({ value }) => Number(value))).toEqual([0, 32, 64, 128, 256]);
  expect(new Set(lightChoices.map(({ label }) => label)).size).toBe(3);
});

test("compression has the choice that a file made, and says what it left out", () => {
  expect(clusterChoicesWith(128)).toEqual(clusterChoices);
  expect(clusterChoicesWith(100).at(-1)).toEqual({ value: "100", label: "100 clusters" });
  expect(compressionInWords(0.03456)).toBe("Compression leaves out 3.5 % of the bake (root mean square); pictures differ less.");
});

test("what is baked anew depends on whether the bake is compressed", () => {
  const [whole, compressed] = [bakeCostInWords(0), bakeCostInWords(64)];
  expect(whole).toContain("Edits of matter bake anew what they touch");
  expect(whole).toContain("compression takes the bake as it is");
  expect(compressed).toContain("bake all anew, another compression too");
  for (const words of [whole, compressed]) expect(words).toContain("Lights turn and change freely");
});

test("baked light takes pictures of light", () => {
  expect(takesPictures("precomputed_transfer")).toBe(true);
});
