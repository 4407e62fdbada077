import { describe, expect, it } from "vitest";
import type { SceneFile } from "../generated/proto";
import { applyPatch, type Patch } from "../scene/mergePatch";
import { EditLog, stepBetween } from "./edits";

/** A scene of which only what is edited matters. */
const start = { density: 1, background: [0, 0, 0], film: { exposure_stops: 0 }, camera: { position: [0, 0, 2] } } as unknown as SceneFile;

/** A scene with its log, edited as the page does. */
function editor() {
  const log = new EditLog();
  let scene = start;
  return {
    log,
    scene: () => scene,
    edit: (patch: Patch, key: string | null = null, at = 0) => {
      const before = scene;
      scene = applyPatch(scene, patch);
      log.edited(before, scene, key, at);
    },
    walk: (patch: Patch | null) => {
      if (patch) scene = applyPatch(scene, patch);
      return patch !== null;
    },
  };
}

describe("undo steps", () => {
  it("are single edits", () => {
    const { log, scene, edit, walk } = editor();
    edit({ density: 2 });
    edit({ density: 3 });
    walk(log.undo());
    expect(scene().density).toBe(2);
    walk(log.undo());
    expect(scene()).toEqual(start);
    expect(walk(log.undo())).toBe(false);
    walk(log.redo());
    walk(log.redo());
    expect(scene().density).toBe(3);
  });

  it("are whole drags", () => {
    const { log, scene, edit, walk } = editor();
    log.beginGesture(scene());
    for (let density = 2; density < 40; density += 1) edit({ density }, "density", density * 1000);
    expect(log.endGesture(scene())).toBe(true);
    walk(log.undo());
    expect(scene()).toEqual(start);
    expect(log.canUndo).toBe(false);
  });

  it("are not made by drags that change nothing", () => {
    const { log, scene } = editor();
    log.beginGesture(scene());
    expect(log.endGesture(scene())).toBe(false);
    expect(log.canUndo).toBe(false);
  });

  it("are bursts of one key, not of two, and not after a pause", () => {
    const { log, scene, edit, walk } = editor();
    edit({ density: 2 }, "density", 0);
    edit({ density: 3 }, "density", 300);
    edit({ film: { exposure_stops: 1 } }, "exposure", 400);
    edit({ film: { exposure_stops: 2 } }, "exposure", 5000);
    walk(log.undo());
    expect(scene().film.exposure_stops).toBe(1);
    walk(log.undo());
    expect(scene()).toMatchObject({ density: 3, film: { exposure_stops: 0 } });
    walk(log.undo());
    expect(scene()).toEqual(start);
  });

  it("vanish when a burst comes back to where it began", () => {
    const { log, edit } = editor();
    edit({ density: 2 }, "density", 0);
    edit({ density: 1 }, "density", 200);
    expect(log.canUndo).toBe(false);
    edit({ density: 3 }, "density", 400);
    expect(log.canUndo).toBe(true);
  });

  it("leave another viewer's edit alone", () => {
    const { log, scene, edit, walk } = editor();
    edit({ density: 2 });
    walk({ background: [1, 1, 1] });
    walk(log.undo());
    expect(scene()).toMatchObject({ density: 1, background: [1, 1, 1] });
  });

  it("go when the server refuses the edit", () => {
    const { log, edit } = editor();
    edit({ density: -1 });
    log.refused("lights");
    expect(log.canUndo).toBe(true);
    log.refused("density");
    expect(log.canUndo).toBe(false);
  });

  it("never move the camera", () => {
    const moved = { ...start, camera: { position: [5, 0, 0] } } as unknown as SceneFile;
    expect(stepBetween(start, moved)).toBeNull();
    expect(stepBetween(start, { ...moved, density: 2 })).toEqual({ redo: { density: 2 }, undo: { density: 1 } });
  });
});
