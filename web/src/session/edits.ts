/** From edits to undo steps: one drag, or one burst of key presses, is one step. */

import type { SceneFile } from "../generated/proto";
import { amend, emptyHistory, forgetLast, record, redo, undo, type History, type Step } from "../scene/history";
import { diffPatch, isEmptyPatch, type Patch } from "../scene/mergePatch";

/** Edits with the same key closer together than this are one step, milliseconds. */
const COALESCE_MILLIS = 700;

export class EditLog {
  private history: History = emptyHistory;
  private gesture: SceneFile | null = null;
  private burst: { key: string; before: SceneFile; at: number } | null = null;

  get canUndo(): boolean {
    return this.history.past.length > 0;
  }

  get canRedo(): boolean {
    return this.history.future.length > 0;
  }

  /** A drag starts: what follows up to `endGesture` is one step. */
  beginGesture(scene: SceneFile): void {
    this.gesture ??= scene;
    this.burst = null;
  }

  /** The drag is over; true if it was a step. */
  endGesture(scene: SceneFile): boolean {
    const before = this.gesture;
    this.gesture = null;
    const step = before && stepBetween(before, scene);
    if (step) this.history = record(this.history, step);
    return step !== null;
  }

  /** An edit led from `before` to `after`. Edits of one `key` in quick succession are one step. */
  edited(before: SceneFile, after: SceneFile, key: string | null, now: number): void {
    if (this.gesture) return;
    const { burst } = this;
    const continues = key !== null && burst?.key === key && now - burst.at < COALESCE_MILLIS;
    const start = continues ? burst.before : before;
    const step = stepBetween(start, after);
    if (!step) {
      // The burst has come back to where it began: there is nothing left to take back.
      if (continues) this.history = forgetLast(this.history);
      this.burst = null;
      return;
    }
    this.burst = key === null ? null : { key, before: start, at: now };
    this.history = continues ? amend(this.history, step) : record(this.history, step);
  }

  /** The patch that takes the newest step back; null if there is none. */
  undo(): Patch | null {
    return this.walk(undo(this.history));
  }

  redo(): Patch | null {
    return this.walk(redo(this.history));
  }

  /** The server refused an edit of the scene's member `root`: it is no step any more. */
  refused(root: string): void {
    const last = this.history.past.at(-1);
    if (last && root in last.redo) this.history = forgetLast(this.history);
    this.burst = null;
  }

  private walk(result: { history: History; patch: Patch } | null): Patch | null {
    this.burst = null;
    if (!result) return null;
    this.history = result.history;
    return result.patch;
  }
}

/** The step from one scene to another; null if only the camera differs. */
export function stepBetween(before: SceneFile, after: SceneFile): Step | null {
  const redoPatch = diffPatch(withoutCamera(before), withoutCamera(after));
  if (isEmptyPatch(redoPatch)) return null;
  return { redo: redoPatch, undo: diffPatch(withoutCamera(after), withoutCamera(before)) };
}

function withoutCamera(scene: SceneFile): object {
  return { ...scene, camera: undefined };
}
