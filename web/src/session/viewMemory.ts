/** Remembers this viewer's camera across a reload of the page. */

import type { Camera } from "../generated/proto";

export interface RememberedView {
  camera: Camera;
  /** Where the scene started. */
  start: Camera;
  /** Whether that start is drawn back in narrow viewports. */
  startFits?: boolean;
}

const keyOf = (session: string): string => `tyndall.view.${session}`;

export function saveView(session: string, view: RememberedView): void {
  try {
    window.sessionStorage.setItem(keyOf(session), JSON.stringify(view));
  } catch {
    // Storage is full or forbidden: the view starts from the session's camera, nothing is lost.
  }
}

export function loadView(session: string): RememberedView | null {
  try {
    const text = window.sessionStorage.getItem(keyOf(session));
    return text === null ? null : (JSON.parse(text) as RememberedView);
  } catch {
    return null;
  }
}
