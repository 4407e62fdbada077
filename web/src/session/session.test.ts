import { describe, expect, it } from "vitest";
import { FLAG_FINAL, FLAG_MOVING, type Camera, type FrameHeader, type FrameReport, type SceneFile } from "../generated/proto";
import { CameraTrail } from "./cameraTrail";
import { Meters } from "./meters";
import { asScene, base64urlFromBytes, bytesFromBase64url, decodeScene, encodeScene, parseAddress, sessionAddress } from "./shareLink";
import { pictureState, reported } from "./store";
import { SceneSync } from "./sync";

const camera: Camera = { position: [0, 0, 2], target: [0, 0, 0], up: [0, 1, 0], fov_y_degrees: 40 };
const scene: SceneFile = {
  version: 1,
  volume: { builtin: "pillars", filter: "linear" },
  density: 1,
  transfer_function: { points: [{ s: 0, opacity: 0.5, albedo: [1, 1, 1], emission: [0, 0, 0] }] },
  materials: {},
  lights: [],
  camera,
  clip: { planes: [], shadows: true },
  background: [0, 0, 0],
  scattering: { orders: "all" },
  illumination: { method: "local", paths_per_pixel: 256, max_error: 0, longest_path: 100000, light_layers: false, refine: false, light_grid: 0.5, light_bands: 3, transport: "characteristics", explicit_steps: 5, diffusion: "p1", heat_spread: 0.05, max_residual: 0.001, photons: 65536, photon_events: 16, photon_grid: 48, photon_bands: 3, gather: "field", direct_grid: 64, records: 32, record_directions: 48, record_bands: 3, record_form: "product", record_lookup: "trilinear", record_window: false, record_exchange: 0, transfer_lights: 162, transfer_grid: 32, transfer_directions: 192, transfer_photons: 262144, transfer_events: 32, transfer_bands: 3, transfer_clusters: 0 },
  sampling: { step_voxels: 0.5, samples_per_pixel: 8, skip_empty: true, termination_transmittance: 0.001, interpolation: "sampler", segments: 4 },
  rendering: { mode: "volume", slice: { normal: [0, 0, 1], offset: 0 } },
  film: { exposure_stops: 0, tone_mapping: "neutral" },
  image: { width: 256, height: 256 },
};

function counter(): () => number {
  let seq = 0;
  return () => (seq += 1);
}

describe("the scene between page and server", () => {
  it("shows an edit at once and keeps it while older scenes arrive", () => {
    const sync = new SceneSync(scene);
    const next = counter();
    sync.edit({ density: 2 });
    expect(sync.takeUnsent(next)).toEqual([{ seq: 1, patch: { density: 2 } }]);
    sync.edit({ density: 3 });
    sync.takeUnsent(next);
    sync.receive(1, { ...scene, density: 2 });
    expect(sync.scene.density).toBe(3);
    expect(sync.settled).toBe(false);
    sync.receive(2, { ...scene, density: 3 });
    expect(sync.settled).toBe(true);
  });

  it("takes another viewer's edit without losing its own", () => {
    const sync = new SceneSync(scene);
    sync.edit({ density: 2 });
    sync.takeUnsent(counter());
    sync.receive(0, { ...scene, background: [1, 1, 1] });
    expect(sync.scene.density).toBe(2);
    expect(sync.scene.background).toEqual([1, 1, 1]);
  });

  it("takes a refused edit out and leaves the others", () => {
    const sync = new SceneSync(scene);
    const next = counter();
    sync.edit({ density: -1 });
    sync.takeUnsent(next);
    sync.edit({ background: [1, 0, 0] });
    sync.takeUnsent(next);
    expect(sync.reject(1)).toBe(true);
    expect(sync.scene.density).toBe(1);
    expect(sync.scene.background).toEqual([1, 0, 0]);
    expect(sync.reject(77)).toBe(false);
  });

  it("sends edits of one moment as one patch", () => {
    const sync = new SceneSync(scene);
    sync.edit({ film: { exposure_stops: 1 } });
    sync.edit({ film: { exposure_stops: 2 }, density: 4 });
    expect(sync.takeUnsent(counter())).toEqual([{ seq: 1, patch: { film: { exposure_stops: 2 }, density: 4 } }]);
  });

  it("sends again what was on its way when the connection broke", () => {
    const sync = new SceneSync(scene);
    const next = counter();
    sync.edit({ density: 2 });
    sync.takeUnsent(next);
    sync.reattach(scene);
    expect(sync.scene.density).toBe(2);
    expect(sync.takeUnsent(next)).toEqual([{ seq: 2, patch: { density: 2 } }]);
  });

  it("keeps this viewer's camera and the identity of what did not change", () => {
    const sync = new SceneSync(scene);
    const mine = { ...camera, position: [1, 0, 0] as [number, number, number] };
    sync.moveCamera(mine);
    const { lights } = sync.scene;
    sync.receive(5, { ...structuredClone(scene), density: 9 });
    expect(sync.scene.camera).toEqual(mine);
    expect(sync.scene.lights).toBe(lights);
    expect(sync.scene.density).toBe(9);
  });
});

describe("an edit that changes nothing", () => {
  it("is not sent", () => {
    const sync = new SceneSync(scene);
    expect(sync.edit({ transfer_function: structuredClone(scene.transfer_function) })).toBe(false);
    expect(sync.edit({ clip: { box: null } })).toBe(false);
    expect(sync.hasUnsent).toBe(false);
    expect(sync.edit({ density: 2 })).toBe(true);
    expect(sync.edit({ density: 2 })).toBe(false);
    expect(sync.takeUnsent(counter())).toEqual([{ seq: 1, patch: { density: 2 } }]);
  });

  it("is sent where the server is to be told all the same", () => {
    const sync = new SceneSync(scene);
    sync.tell({ camera: scene.camera });
    expect(sync.hasUnsent).toBe(true);
  });
});

describe("a refused camera", () => {
  const at = (z: number): Camera => ({ ...camera, position: [0, 0, z] });

  it("leads back to the one before it", () => {
    const trail = new CameraTrail(camera);
    trail.sent(3, at(3));
    trail.sent(5, at(5));
    expect(trail.refused(5)).toEqual({ camera: at(5), before: at(3) });
    expect(trail.refused(3)).toEqual({ camera: at(3), before: camera });
  });

  it("leads back to the newest one that was drawn", () => {
    const trail = new CameraTrail(camera);
    trail.sent(3, at(3));
    trail.sent(4, at(4));
    trail.shown(4);
    trail.sent(7, at(7));
    expect(trail.refused(7)?.before).toEqual(at(4));
  });

  it("is told from a refused edit", () => {
    const trail = new CameraTrail(camera);
    trail.sent(3, at(3));
    expect(trail.refused(2)).toBeNull();
  });
});

describe("the state of the picture", () => {
  const moving = { link: "open", frame: { flags: FLAG_MOVING } as FrameHeader, awaitingPicture: false, progress: null } as const;

  it("is moving only while inputs come", () => {
    expect(pictureState({ ...moving, atRest: false })).toBe("moving");
    expect(pictureState({ ...moving, atRest: true })).toBe("refining");
    expect(pictureState({ ...moving, frame: { flags: FLAG_FINAL } as FrameHeader, atRest: true })).toBe("final");
  });
});

describe("a report", () => {
  const report: FrameReport = { changes: [], plan: [], stages: [], counters: {}, gpu_bytes: {} };
  const stages = [{ stage: "ray cast", millis: 1 }];

  it("replaces only what it tells of", () => {
    const refined = { ...report, stages };
    expect(reported(refined)).toEqual({ report: refined, pictureReport: refined });
    const unseen = { ...report, changes: ["shadows of clipped matter"] };
    expect(reported(unseen)).toEqual({ report: unseen, changeReport: unseen });
    const compressed = { ...report, counters: { transfer_rows: 100, transfer_compression_error_ppm: 20000 } };
    expect(reported(compressed)).toEqual({ report: compressed, compressionError: 0.02, bakeIsMade: false });
    const whole = { ...report, counters: { transfer_rows: 100 } };
    expect(reported(whole)).toEqual({ report: whole, compressionError: null, bakeIsMade: false });
    const made = { ...report, counters: { transfer_rows: 100, transfer_made: 1 } };
    expect(reported(made)).toMatchObject({ bakeIsMade: true });
  });
});

describe("meters", () => {
  it("measure from the newest shown input to its picture", () => {
    const meters = new Meters();
    meters.inputSent(1, 100);
    meters.inputSent(2, 110);
    meters.inputSent(3, 120);
    meters.frameShown(2, 150);
    expect(meters.read(150).latencyMillis).toBe(40);
    meters.frameShown(2, 170);
    expect(meters.read(170).latencyMillis).toBe(40);
  });

  it("forget inputs when the connection is gone", () => {
    const meters = new Meters();
    meters.inputSent(1, 0);
    meters.disconnected();
    meters.frameShown(1, 9000);
    expect(meters.read(9000).latencyMillis).toBeNull();
  });

  it("count pictures and bits of the last two seconds", () => {
    const meters = new Meters();
    for (let at = 0; at < 2000; at += 100) meters.frameArrived(12_500, at);
    expect(meters.read(1999).framesPerSecond).toBe(10);
    expect(meters.read(1999).megabitsPerSecond).toBeCloseTo(1, 9);
    expect(meters.read(9000).framesPerSecond).toBe(0);
  });
});

describe("share links", () => {
  it("restore the scene", async () => {
    const code = await encodeScene(scene);
    expect(code).toMatch(/^[A-Za-z0-9_-]+$/);
    expect(await decodeScene(code)).toEqual(scene);
  });

  it("say so when they are cut off", async () => {
    const code = await encodeScene(scene);
    await expect(decodeScene(code.slice(0, 40))).rejects.toThrow("does not hold a whole scene");
    await expect(decodeScene("!!!")).rejects.toThrow("does not hold a whole scene");
  });

  it("carry any bytes", () => {
    const bytes = Uint8Array.from({ length: 256 }, (_, i) => i);
    expect(bytesFromBase64url(base64urlFromBytes(bytes))).toEqual(bytes);
  });

  it("are told apart from sessions", () => {
    expect(parseAddress(sessionAddress("a b"))).toEqual({ kind: "session", id: "a b" });
    expect(parseAddress("#scene=abc-_")).toEqual({ kind: "scene", code: "abc-_" });
    expect(parseAddress("")).toEqual({ kind: "none" });
    expect(() => asScene({ version: 1 })).toThrow("not a scene file");
  });
});
