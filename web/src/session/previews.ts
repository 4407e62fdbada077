/** Small pictures drawn by the service, asked for one at a time and behind what viewers move. */

import { postPreview } from "../api/rest";
import { Turns } from "../datasets/turns";
import type { PreviewRequest } from "../generated/proto";

/** More device pixels than these would not be seen. */
const MAX_PIXEL_RATIO = 2;

const turns = new Turns(1);

/** The size to ask for, device pixels, of a picture of this size in CSS pixels. */
export function previewSize(width: number, height: number): { width: number; height: number } {
  const ratio = Math.min(MAX_PIXEL_RATIO, Math.max(1, window.devicePixelRatio));
  return { width: Math.round(width * ratio), height: Math.round(height * ratio) };
}

/** Asks when its turn comes; returns what stops asking. A picture that arrives all the same is handed over. */
export function askPreview(sessionId: string, request: PreviewRequest, drawn: (blob: Blob, stopped: boolean) => void, missing: () => void): () => void {
  const stop = new AbortController();
  const release = turns.ask(() => {
    postPreview(sessionId, request, stop.signal).then(
      (blob) => drawn(blob, stop.signal.aborted),
      () => stop.signal.aborted || missing(),
    ).finally(() => release());
  });
  return () => {
    stop.abort();
    release();
  };
}
