import { describe, expect, it } from "vitest";
import type { Camera, Light, SceneFile } from "../generated/proto";
import { applyPatch, diffPatch } from "../scene/mergePatch";
import {
  chooseMethod, choosePicture, columnBehind, meanRadiance, pictureOfScene, turnOf, withoutPicture, withPicture, withTurn, wrapped, type EnvironmentLight,
} from "./environments";

const room: EnvironmentLight = { type: "environment", id: "room", enabled: true, radiance: [0.2, 0.2, 0.1] };
const studio: EnvironmentLight = { type: "environment", id: "room", enabled: true, image: "studio", scale: 0.7 };
const sun: Light = { type: "directional", enabled: true, direction: [0, -1, 0], irradiance: [1, 1, 1] };

const lit = (method: SceneFile["illumination"]["method"], ...lights: Light[]) =>
  ({ lights, illumination: { method, paths_per_pixel: 256, max_error: 0, longest_path: 100 } }) as SceneFile;

const pictures = [{ id: "studio", mean_radiance: [0.7, 0.5, 0.2] as [number, number, number] }, { id: "old" }];
const mean = (image: string | undefined) => meanRadiance(pictures, image);

describe("environment lights", () => {
  it("knows how bright a picture is, and takes a middle where it does not", () => {
    expect(mean("studio")).toEqual([0.7, 0.5, 0.2]);
    for (const image of ["old", "gone", undefined]) expect(mean(image)).toEqual([0.5, 0.5, 0.5]);
    expect(meanRadiance(null, "studio")).toEqual([0.5, 0.5, 0.5]);
  });

  it("switches a method that refuses pictures in the edit that chooses one", () => {
    const scene = lit("local", sun, room);
    const { patch, switched } = choosePicture(scene, 1, "studio", false);
    expect(switched).toBe(true);
    const after = applyPatch<SceneFile>(scene, patch);
    expect(after.illumination).toEqual({ ...scene.illumination, method: "path_traced" });
    expect(after.lights).toEqual([{ ...sun, id: "0" }, { type: "environment", id: "room", enabled: true, image: "studio", scale: 1 }]);
    // One step back brings both back.
    expect(applyPatch(after, diffPatch(after, scene))).toEqual(scene);
  });

  it("leaves a method that draws pictures, and other lights with an image of the same index", () => {
    expect(choosePicture(lit("path_traced", room), 0, "sky", false)).toMatchObject({ switched: false, patch: { lights: [{ image: "sky" }] } });
    expect(choosePicture(lit("path_traced", room), 0, "sky", false).patch).not.toHaveProperty("illumination");
    expect(choosePicture(lit("path_traced", sun), 0, "sky", false).patch).toEqual({ lights: [{ ...sun, id: "0" }] });
  });

  it("takes pictures off for a method that refuses them, and only then", () => {
    const scene = lit("path_traced", sun, studio);
    const { patch, tookPicture } = chooseMethod(scene, "local", mean);
    expect(tookPicture).toBe(true);
    const after = applyPatch<SceneFile>(scene, patch);
    expect(after.lights[1]).toEqual({ type: "environment", id: "room", enabled: true, radiance: [0.49, 0.35, 0.14] });
    expect(pictureOfScene(after)).toBeNull();
    expect(chooseMethod(scene, "photon_map", mean)).toEqual({ patch: { illumination: { method: "photon_map" } }, tookPicture: false, switchedOff: 0 });
    expect(chooseMethod(lit("path_traced", room), "local", mean)).toEqual({ patch: { illumination: { method: "local" } }, tookPicture: false, switchedOff: 0 });
  });

  it("switches lights with a place off for a method of distant light, and only then", () => {
    const lamp: Light = { type: "point", id: "lamp", enabled: true, position: [0, 1, 0], intensity: [1, 1, 1] };
    const scene = lit("photon_map", sun, lamp, { ...lamp, id: "off", enabled: false }, studio);
    const { patch, switchedOff, tookPicture } = chooseMethod(scene, "precomputed_transfer", mean);
    expect([switchedOff, tookPicture]).toEqual([1, false]);
    const after = applyPatch<SceneFile>(scene, patch);
    expect(after.lights.map(({ enabled }) => enabled)).toEqual([true, false, false, true]);
    expect(after.lights[3]).toEqual(studio);
    expect(chooseMethod(scene, "path_traced", mean).switchedOff).toBe(0);
  });

  it("stands pictures upright in anatomical axes and keeps the turn from picture to picture", () => {
    expect(withPicture(room, "sky", true).rotation_degrees).toEqual([90, 0, 0]);
    expect(withPicture(room, "sky", false).rotation_degrees).toBeUndefined();
    const turned = { ...studio, rotation_degrees: [90, 0, 30] as [number, number, number] };
    expect(withPicture(turned, "sky", true)).toEqual({ ...turned, image: "sky" });
    expect(withoutPicture(room, [1, 1, 1])).toBe(room);
  });

  it("turns about the upright axis and comes round", () => {
    expect([0, 180, -180, 181, 540, -725].map(wrapped)).toEqual([0, 180, 180, -179, 180, -5]);
    const y = withTurn(studio, 190, false);
    expect(y.rotation_degrees).toEqual([0, 170, 0]);
    expect(turnOf(y, false)).toBe(-170);
    expect(withTurn(studio, -123.456, false).rotation_degrees).toEqual([0, 123.46, 0]);
    expect(withTurn({ ...studio, rotation_degrees: [90, 0, 0] }, 40, true).rotation_degrees).toEqual([90, 0, -40]);
  });

  it("finds the column behind the volume", () => {
    const from = (position: Camera["position"], up: Camera["up"]): Camera => ({ position, target: [0, 0, 0], up, fov_y_degrees: 40 });
    const front = from([0, 0, 2], [0, 1, 0]);
    // The left edge of a picture lies along -z; further columns lie further to the right.
    expect(columnBehind(studio, front, false)).toBeCloseTo(0);
    expect(columnBehind(studio, from([-2, 0, 0], [0, 1, 0]), false)).toBeCloseTo(0.25);
    // Turned to the right, what was left of the middle is in it.
    expect(columnBehind(withTurn(studio, 90, false), front, false)).toBeCloseTo(0.75);
    // From above, the picture's upper edge points away from the viewer in front.
    expect(columnBehind(studio, from([0, 2, 0], [0, 0, -1]), false)).toBeCloseTo(0);
    expect(columnBehind(studio, from([0, -2, 0], [0, 0, 1]), false)).toBeCloseTo(0);
    // Anatomical axes: the viewer in front looks along +y, the patient's left is at the right.
    expect(columnBehind(studio, from([0, -2, 0], [0, 0, 1]), true)).toBeCloseTo(0);
    expect(columnBehind(studio, from([-2, 0, 0], [0, 0, 1]), true)).toBeCloseTo(0.25);
  });
});
