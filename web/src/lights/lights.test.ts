import { describe, expect, it } from "vitest";
import type { Camera, Light } from "../generated/proto";
import { add, dot, length, scale, sub, type Triple } from "../scene/vec";
import { toView } from "../viewport/camera";
import {
  comeFrom, freeId, lightHue, lightNames, lightStrength, newLight, placeOf, setHue, setStrength, towardsLight, withIds, type LightType,
} from "./lights";
import { rigs } from "./rigs";
import { aimOf, outlineOf, shinesTo } from "./gizmo";
import { directionAt, directionInWords, placeAt, turned } from "./sphere";

const camera: Camera = { position: [2, 1, 0], target: [0, 0, 0], up: [0, 1, 0], fov_y_degrees: 40 };
const types = Object.keys(lightNames) as LightType[];

describe("every type of light", () => {
  it.each(types)("%s: strength and colour are independent", (type) => {
    const light = newLight(type, [0, 1, 0], "a");
    const red = setHue(light, [0.5, 0.25, 0]);
    expect(lightStrength(red)).toBeCloseTo(lightStrength(light), 5);
    expect(lightHue(red)).toEqual([1, 0.5, 0]);
    expect(lightStrength(setStrength(red, 7))).toBe(7);
    expect(lightHue(setStrength(red, 7))).toEqual([1, 0.5, 0]);
  });

  it.each(types.filter((type) => type !== "environment"))("%s: comes from where it is put and keeps its distance", (type) => {
    const light = newLight(type, [0, 1, 0], "a");
    const moved = comeFrom(light, [1, 0, 0]);
    expect(dot(towardsLight(moved) ?? [0, 0, 0], [1, 0, 0])).toBeCloseTo(1, 4);
    const place = placeOf(light);
    if (place) expect(length(placeOf(moved) ?? [0, 0, 0])).toBeCloseTo(length(place), 4);
    if (moved.type === "rectangle") expect(Math.abs(dot(moved.normal, moved.up))).toBeLessThan(0.99);
  });

  it("keeps an environment image and changes its scale", () => {
    const map: Light = { type: "environment", enabled: true, image: "studio.hdr", scale: 2 };
    expect(setStrength(map, 5)).toEqual({ ...map, scale: 5 });
  });
});

describe("ids", () => {
  it("are free and stay when an earlier light goes", () => {
    const sun: Light = { type: "directional", enabled: true, direction: [0, -1, 0], irradiance: [1, 1, 1] };
    const lights = withIds([sun, sun, { ...sun, id: "directional-1" }]);
    expect(lights.map((light) => light.id)).toEqual(["0", "1", "directional-1"]);
    expect(freeId(lights, "directional")).toBe("directional-2");
  });
});

describe("the direction sphere", () => {
  it.each<Triple>([[0, 0, 1], [0.6, 0, 0.8], [0.36, 0.48, -0.8], [-0.8, 0.6, 0]])("goes there and back: %j", (...direction) => {
    expect(length(sub(directionAt(...placeAt(direction)), direction))).toBeLessThan(1e-9);
  });

  it("holds the way straight from behind at its outermost circle", () => {
    expect(directionAt(0, 2)[2]).toBeCloseTo(-1, 9);
    expect(directionAt(0, 9)[2]).toBeCloseTo(-1, 9);
  });
});

describe("rigs", () => {
  it("are placed as the viewer sees them, with ids of their own", () => {
    for (const rig of rigs) {
      const lights = rig.lights(camera);
      expect(new Set(lights.map((light) => light.id)).size).toBe(lights.length);
    }
    const key = rigs[0]?.lights(camera)[0];
    const [x = 0, y = 0, z = 0] = key ? toView(camera, towardsLight(key) ?? [0, 0, 0]) : [];
    expect(x).toBeLessThan(0);
    expect(y).toBeGreaterThan(0);
    expect(z).toBeGreaterThan(0);
  });
});

describe("keys on the direction sphere", () => {
  it("turn to the right and upwards as seen, and stop at the poles", () => {
    const right = turned([0, 0, 1], 30, 0);
    expect(right[0]).toBeCloseTo(0.5, 9);
    expect(turned([0, 0, 1], 0, 30)[1]).toBeCloseTo(0.5, 9);
    expect(turned([0.6, 0, -0.8], 0, 30)[1]).toBeCloseTo(0.5, 9);
    expect(length(turned([0.6, 0, -0.8], 17, 200))).toBeCloseTo(1, 9);
    expect(turned([0, 0, 1], 0, 200)[1]).toBeLessThan(1);
    expect(turned([0, 1, 0], 0, -30)[1]).toBeCloseTo(Math.cos(Math.PI / 6), 9);
  });

  it("say where the light comes from", () => {
    expect(directionInWords([-0.7, 0.7, 0])).toBe("from above, the left");
    expect(directionInWords([0, 0, -1])).toBe("from behind");
  });
});

describe("light gizmos", () => {
  const facing: [Triple, Triple] = [[1, 0, 0], [0, 1, 0]];

  it.each(types)("%s: drawn about its place", (type) => {
    const light = newLight(type, [0, 1, 0], "a");
    const place = placeOf(light);
    const lines = outlineOf(light, facing);
    expect(lines.length > 0).toBe(["spot", "rectangle", "disk", "sphere"].includes(type));
    for (const { points } of lines) for (const point of points) expect(length(sub(point, place ?? [0, 0, 0]))).toBeLessThan(2);
    expect(aimOf(light) === null).toBe(shinesTo(light) === null);
  });

  it("keep size and cone of the light", () => {
    const disk = newLight("disk", [0, 1, 0], "a");
    const [ring] = outlineOf(disk, facing);
    for (const point of ring?.points ?? []) expect(length(sub(point, placeOf(disk) ?? [0, 0, 0]))).toBeCloseTo(0.4, 6);
    const spot = newLight("spot", [0, 0, 1], "a");
    if (spot.type !== "spot") throw new Error("a spot");
    const rim = outlineOf(spot, facing)[0]?.points[0] ?? [0, 0, 0];
    const way = sub(rim, spot.position);
    expect(Math.acos(dot(way, spot.direction) / length(way)) * (180 / Math.PI)).toBeCloseTo(spot.cone_degrees[1], 4);
    expect(length(aimOf(spot) ?? [1, 1, 1])).toBeCloseTo(0, 4);
  });

  it("aim in front of a light that looks away", () => {
    const disk = newLight("disk", [0, 1, 0], "a");
    if (disk.type !== "disk") throw new Error("a disk");
    const away = { ...disk, normal: [0, 1, 0] as Triple };
    expect(aimOf(away)).toEqual(add(disk.center, scale([0, 1, 0], 0.7)));
  });
});
