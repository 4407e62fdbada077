import { describe, expect, it } from "vitest";
import type { FrameHeader, Method, SceneFile } from "../generated/proto";
import { sinceEpoch } from "../session/store";
import { missingLight } from "./missingLight";

const scene = (method: Method, transfer_clusters = 0) => ({ illumination: { method, transfer_clusters }, rendering: { mode: "volume" } }) as unknown as SceneFile;
const frame = (illumination_completeness: number, snapshot_epoch = 7, illumination_epoch = snapshot_epoch) => ({ illumination_completeness, snapshot_epoch, illumination_epoch }) as FrameHeader;
const of = (method: Method, clusters = 0) => ({
  frame: frame(0.349), scene: scene(method, clusters), methodSince: { method, epoch: 5 }, bakeIsMade: false, lightMillis: null, awaitingPicture: false, link: "open" as const,
});

describe("light that is on its way", () => {
  it("is told of by every method, with how much there is", () => {
    expect(missingLight(of("photon_map"))).toMatchObject({ what: "Light", percent: 34, amount: "34 %", old: false });
    expect(missingLight({ ...of("image_based"), lightMillis: 12_300 })).toMatchObject({ what: "Light", amount: "34 %, 12 s left" });
    expect(missingLight(of("precomputed_transfer"))).toMatchObject({ what: "Baking light", amount: "34 %" });
  });

  it("is told of only where a picture lacks it", () => {
    expect(missingLight({ ...of("photon_map"), frame: null })).toBeNull();
    expect(missingLight({ ...of("photon_map"), frame: frame(1) })).toBeNull();
    expect(missingLight({ ...of("photon_map"), awaitingPicture: true })).toBeNull();
    expect(missingLight({ ...of("photon_map"), link: "lost" })).toBeNull();
  });

  it("says whether it is old", () => {
    const old = { ...of("precomputed_transfer"), frame: frame(0.1, 7, 6) };
    expect(missingLight(old)).toMatchObject({ what: "Light of before the edit; baking anew", old: true });
    // The newest report may be of the bake before.
    expect(missingLight({ ...old, bakeIsMade: true })).toMatchObject({ old: true, amount: "10 %" });
  });

  it("has no share where a bake is made and stored or compressed", () => {
    const made = { bakeIsMade: true, frame: frame(0.995), lightMillis: 900 };
    expect(missingLight({ ...of("precomputed_transfer", 64), ...made })).toMatchObject({ what: "Compressing the bake", percent: null, amount: null });
    expect(missingLight({ ...of("precomputed_transfer"), ...made })).toMatchObject({ what: "Storing the bake", percent: null, amount: null });
  });
});

describe("another method's light", () => {
  const photons = sinceEpoch(null, "photon_map", 5);

  it("is not told as the scene's, before the server knows of the method and until a picture has it", () => {
    const chosen = { ...of("precomputed_transfer"), methodSince: photons };
    expect(missingLight(chosen), "the edit is on its way").toBeNull();
    const known = { ...chosen, methodSince: sinceEpoch(photons, "precomputed_transfer", 8) };
    expect(missingLight(known), "the picture is of before").toBeNull();
    expect(missingLight({ ...known, frame: frame(0.02, 8) })).toMatchObject({ amount: "2 %" });
  });

  it("begins with the first scene of its method", () => {
    const baked = sinceEpoch(photons, "precomputed_transfer", 8);
    expect(sinceEpoch(baked, "precomputed_transfer", 9)).toBe(baked);
    expect(sinceEpoch(baked, "photon_map", 10)).toEqual({ method: "photon_map", epoch: 10 });
  });
});
