/** The cameras this viewer has sent: where the view goes back to when the server refuses one. */

import type { Camera } from "../generated/proto";

/** Cameras without an answer that are remembered; older ones are forgotten. */
const MAX_UNANSWERED = 512;

export class CameraTrail {
  private unanswered: { seq: number; camera: Camera }[] = [];
  private seen: Camera;

  /** `camera` is one the server has itself. */
  constructor(camera: Camera) {
    this.seen = camera;
  }

  /** Input `seq` was this camera. */
  sent(seq: number, camera: Camera): void {
    this.unanswered = [...this.unanswered, { seq, camera }].slice(-MAX_UNANSWERED);
  }

  /** A picture with all inputs up to `seq` is there: the server has drawn their newest camera. */
  shown(seq: number): void {
    const newest = this.unanswered.findLast((sent) => sent.seq <= seq);
    if (!newest) return;
    this.seen = newest.camera;
    this.unanswered = this.unanswered.filter((sent) => sent.seq > seq);
  }

  /** Input `seq` was refused: the refused camera and the one before it; null if `seq` was no camera. */
  refused(seq: number): { camera: Camera; before: Camera } | null {
    const index = this.unanswered.findIndex((sent) => sent.seq === seq);
    const refused = this.unanswered[index];
    if (!refused) return null;
    const before = this.unanswered[index - 1]?.camera ?? this.seen;
    this.unanswered = this.unanswered.filter((sent) => sent !== refused);
    return { camera: refused.camera, before };
  }
}
