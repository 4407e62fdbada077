import { describe, expect, it } from "vitest";
import type { FrameHeader, FrameReport, Illumination, Light, Method, SceneFile } from "../generated/proto";
import { canBeRefined, samplesAtRest, shortcoming, whyNotMixed, withoutEffect } from "../quality/methods";
import { editRows, editTimes, formatCount, headline, keptShare, lightInWords, lightPercent, passesRun, reusedShare, showsOldLight, skippedShare, stageTime, stateInWords } from "./figures";

const illumination = (method: Method): Illumination => ({ method, paths_per_pixel: 256, max_error: 0, longest_path: 100000, light_layers: false, refine: false, light_grid: 0.5, light_bands: 3, transport: "characteristics", explicit_steps: 5, diffusion: "p1", heat_spread: 0.05, max_residual: 0.001, photons: 65536, photon_events: 16, photon_grid: 48, photon_bands: 3, gather: "field", direct_grid: 64, records: 32, record_directions: 48, record_bands: 3, record_form: "product", record_lookup: "trilinear", record_window: false, record_exchange: 0, transfer_lights: 162, transfer_grid: 32, transfer_directions: 192, transfer_photons: 262144, transfer_events: 32, transfer_bands: 3, transfer_clusters: 0 });
const frame = { samples_per_pixel: 3, width: 640, height: 360, viewport_width: 640, viewport_height: 360 } as FrameHeader;
const report = (counters: Record<string, number>): FrameReport => ({ changes: [], plan: [], stages: [], counters, gpu_bytes: {} });

describe("samples of a final picture", () => {
  const scene = (method: Method, refine: boolean, mode: "volume" | "maximum" = "volume") =>
    ({ illumination: { ...illumination(method), refine }, sampling: { samples_per_pixel: 8 }, rendering: { mode } }) as SceneFile;

  it("are view rays, or paths, or paths after rays", () => {
    expect(samplesAtRest(scene("local", true))).toBe(8);
    expect(samplesAtRest(scene("photon_map", false))).toBe(8);
    expect(samplesAtRest(scene("photon_map", true))).toBe(264);
    expect(samplesAtRest(scene("photon_map", true, "maximum"))).toBe(8);
    expect(samplesAtRest(scene("path_traced", false))).toBe(256);
  });

  it("are refined where all of light is approximated", () => {
    const refined = (["local", "convection_diffusion", "image_based", "photon_map", "precomputed_transfer", "path_traced"] as const).filter((method) => canBeRefined(scene(method, true)));
    expect(refined).toEqual(["convection_diffusion", "photon_map", "precomputed_transfer"]);
  });
});

describe("the status line", () => {
  it("says how far the picture is", () => {
    expect(stateInWords("refining", frame, 8)).toBe("refining 37 %");
    expect(stateInWords("refining", { ...frame, samples_per_pixel: 8 }, 8)).toBe("refining 99 %");
    expect(stateInWords("refining", { ...frame, width: 160, height: 90, samples_per_pixel: 1 }, 1)).toBe("refining 6 %");
    expect(stateInWords("final", frame, 8)).toBe("final");
    expect(stateInWords("loading", null, 8)).toBe("loading");
  });

  it("gives the share of skipped samples only where it is known", () => {
    expect(skippedShare(report({ samples_taken: 25, samples_skipped: 75 }))).toBe(0.75);
    expect(skippedShare(report({ samples_taken: 25 }))).toBeNull();
    expect(skippedShare(report({ samples_taken: 0, samples_skipped: 0 }))).toBeNull();
    expect(skippedShare(null)).toBeNull();
  });

  it("gives the share of reused rays only where some were kept", () => {
    expect(reusedShare(report({ segments_reused: 30, segments_cast: 10 }))).toBe(0.75);
    expect(reusedShare(report({ segments_reused: 0, segments_cast: 0 }))).toBeNull();
    expect(reusedShare(report({ samples_taken: 25 }))).toBeNull();
    expect(reusedShare(report({ tiles_reused: 1, tiles_recomputed: 3 }))).toBe(0.25);
    expect(reusedShare(null)).toBeNull();
  });

  it("tells what became of the newest edit", () => {
    const work = { seq: 3, firstMillis: 48.4, litMillis: null, finalMillis: null, completeness: 0.429, kinds: [{ name: "photons", redone: 1500, reused: 4500 }] };
    expect(editTimes(null)).toBe("–");
    expect(editTimes({ ...work, firstMillis: null })).toBe("–");
    expect(editTimes(work)).toBe("48 ms / …");
    expect(editTimes({ ...work, finalMillis: 1234 })).toBe("48 ms / 1.23 s");
    expect(keptShare(work)).toBe(0.75);
    expect(keptShare({ ...work, kinds: [] })).toBeNull();
    expect(editRows(work)).toEqual([["first picture", "48 ms"], ["all of the light", "42 % of it"], ["final picture", "on its way"], ["photons", "1.50 k redone, 4.50 k reused"]]);
    expect([1, 0.999, 0].map((illumination_completeness) => lightPercent({ illumination_completeness }))).toEqual([null, 99, 0]);
  });

  it("tells how long light takes, and whether what is shown is old", () => {
    const lit = (illumination_completeness: number, illumination_epoch = 4) => ({ illumination_completeness, illumination_epoch, snapshot_epoch: 4 });
    expect(lightInWords(null, 100)).toBeNull();
    expect(lightInWords(lit(1), 100)).toBeNull();
    expect(lightInWords(lit(0.349), null)).toBe("34 %");
    expect(lightInWords(lit(0.349), 12_300)).toBe("34 %, 12 s left");
    expect(lightInWords(lit(0.9), 20)).toBe("90 %, 1 s left");
    expect(lightInWords(lit(0.1), 200_000)).toBe("10 %, 3 min left");
    expect([null, lit(1, 3), lit(0.5), lit(0.5, 3)].map(showsOldLight)).toEqual([false, false, false, true]);
  });

  it("writes counts short", () => {
    expect([7, 999, 1234, 1_234_567].map(formatCount)).toEqual(["7", "999", "1.23 k", "1.23 M"]);
  });
});

describe("the statistics", () => {
  const pass = { pass: "ray_cast", reason: "image size is now 4 x 4", work: 16, unit: "pixel samples" };
  const refined: FrameReport = { ...report({}), plan: [{ ...pass, runs: true }, { ...pass, pass: "upload_volume", runs: false }] };

  it("keep naming the last change while the picture is refined", () => {
    expect(headline({ ...refined, changes: ["exposure", "camera"] }, refined)).toBe("Last change: exposure, camera");
    expect(headline(null, refined)).toContain("Nothing has been changed");
  });

  it("say what ran, and why", () => {
    expect(passesRun(refined)).toEqual(["ray cast: image size is now 4 x 4"]);
  });
});

describe("a method", () => {
  const lamp: Light = { type: "point", enabled: true, position: [0, 0, 0], intensity: [1, 1, 1] };
  const sky: Light = { type: "environment", enabled: true, radiance: [1, 1, 1] };
  const smoke = { materials: {}, transfer_function: { points: [] } };

  it("says that narrow peaks ask for the photons themselves", () => {
    const matter = (g: number) => ({ lights: [lamp], materials: { fog: { phase: { type: "henyey_greenstein" as const, g }, surface: 0 } }, transfer_function: { points: [{ s: 0, albedo: [1, 1, 1] as [number, number, number], emission: [0, 0, 0] as [number, number, number], material: "fog" }] } });
    expect(shortcoming({ illumination: illumination("photon_map"), ...matter(0.9) })).toContain("fog");
    expect(shortcoming({ illumination: illumination("photon_map"), ...matter(0.8) })).toBeNull();
    expect(shortcoming({ illumination: { ...illumination("photon_map"), gather: "ray" }, ...matter(0.9) })).toBeNull();
    expect(shortcoming({ illumination: illumination("photon_map"), ...matter(0.9), transfer_function: { points: [] } })).toBeNull();
  });

  it("says what it makes of lights with an extent", () => {
    const disk: Light = { type: "disk", enabled: true, center: [0, 1, 0], normal: [0, -1, 0], radius: 0.2, radiance: [1, 1, 1] };
    expect(shortcoming({ ...smoke, illumination: illumination("image_based"), lights: [disk, sky] })).toContain("sharp");
    expect(shortcoming({ ...smoke, illumination: illumination("image_based"), lights: [{ ...disk, enabled: false }, lamp, sky] })).toBeNull();
    expect(shortcoming({ ...smoke, illumination: illumination("photon_map"), lights: [disk] })).toBeNull();
    expect(shortcoming({ ...smoke, illumination: illumination("precomputed_transfer"), lights: [{ ...lamp, enabled: false }, sky] })).toBeNull();
    expect(shortcoming({ ...smoke, illumination: illumination("precomputed_transfer"), lights: [{ ...sky, enabled: false }] })).toContain("No distant light");
    expect(withoutEffect("image_based", "clip shadows")).toBeNull();
  });

  it("mixes at most eight lights, those that are off among them", () => {
    const lights = Array.from({ length: 9 }, () => ({ ...lamp, enabled: false }));
    expect(whyNotMixed(lights.slice(1))).toBeNull();
    expect(whyNotMixed(lights)).toContain("there are 9");
  });

  it("says by which clock a stage was timed", () => {
    expect(stageTime({ stage: "ray_cast", millis: 3.456 })).toBe("3.46 ms");
    expect(stageTime({ stage: "ray_cast", millis: 3.456, device_millis: 1.2 })).toBe("3.46 ms, device 1.20 ms");
  });
});
