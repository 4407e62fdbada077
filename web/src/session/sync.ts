/**
 * The scene as this page shows it: the server's newest scene plus the edits that are on their way.
 *
 * An edit shows at once. The server answers with the whole scene and the newest input in it; what
 * it has not seen yet is put on top again. A refused edit is taken out and the rest stays. The
 * camera belongs to this viewer and never comes from the server after the first scene.
 */

import type { Camera, SceneFile } from "../generated/proto";
import { applyPatch, composePatches, deepEqual, shareStructure, type Patch } from "../scene/mergePatch";

interface Sent {
  seq: number;
  patch: Patch;
}

export class SceneSync {
  /** The scene to show. */
  scene: SceneFile;
  private server: SceneFile;
  private sent: Sent[] = [];
  private unsent: Patch[] = [];

  constructor(scene: SceneFile) {
    this.server = scene;
    this.scene = scene;
  }

  /** An edit by this viewer; false, and nothing is sent, if the scene is so already. */
  edit(patch: Patch): boolean {
    if (deepEqual(applyPatch(this.scene, patch), this.scene)) return false;
    this.tell(patch);
    return true;
  }

  /** Sends a patch whether or not it changes what this viewer sees. */
  tell(patch: Patch): void {
    this.scene = applyPatch(this.scene, patch);
    const last = this.unsent.at(-1);
    const composed = last && composePatches(last, patch);
    if (composed) this.unsent[this.unsent.length - 1] = composed;
    else this.unsent.push(patch);
  }

  /** This viewer's camera. */
  moveCamera(camera: Camera): void {
    this.scene = { ...this.scene, camera };
  }

  /** Edits to send now, numbered; from here on they are on their way. */
  takeUnsent(nextSeq: () => number): Sent[] {
    const taken = this.unsent.map((patch) => ({ seq: nextSeq(), patch }));
    this.unsent = [];
    this.sent.push(...taken);
    return taken;
  }

  get hasUnsent(): boolean {
    return this.unsent.length > 0;
  }

  /** Whether every edit has been answered. */
  get settled(): boolean {
    return this.sent.length === 0 && this.unsent.length === 0;
  }

  /** The server's scene, which contains this viewer's inputs up to `seq`. */
  receive(seq: number, scene: SceneFile): void {
    this.server = scene;
    this.sent = this.sent.filter((edit) => edit.seq > seq);
    this.rebase();
  }

  /** The server refused input `seq`; false if it was no edit of the scene. */
  reject(seq: number): boolean {
    const before = this.sent.length;
    this.sent = this.sent.filter((edit) => edit.seq !== seq);
    if (this.sent.length === before) return false;
    this.rebase();
    return true;
  }

  /** A new connection to the same session: what was on its way is sent again. */
  reattach(scene: SceneFile): void {
    this.server = scene;
    this.unsent = [...this.sent.map((edit) => edit.patch), ...this.unsent];
    this.sent = [];
    this.rebase();
  }

  private rebase(): void {
    const { camera } = this.scene;
    let scene = this.server;
    for (const edit of this.sent) scene = applyPatch(scene, edit.patch);
    for (const patch of this.unsent) scene = applyPatch(scene, patch);
    this.scene = shareStructure(this.scene, camera ? { ...scene, camera } : scene);
  }
}
