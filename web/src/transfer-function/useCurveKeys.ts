/** Keys and the clipboard while the focus is in the editor. */

import { useRef, type ClipboardEvent, type KeyboardEvent } from "react";
import { useUi } from "../app/uiStore";
import type { TransferFunctionPoint } from "../generated/proto";
import { addOnCurve, copyText, removeSelected, select, selectAll, setPoints, take } from "./curve";
import { sAt, type Plot } from "./geometry";
import { movePoints } from "./points";
import { withToggled } from "./selection";
import { panWindow, zoomWindow, type Range } from "./valueAxis";

/** Nudge of an arrow key: shares of the value window and of the opacity axis; Shift takes ten. */
const NUDGE_S = 1 / 400;
const NUDGE_HEIGHT = 1 / 200;
/** What `+` leaves of the window, and how far arrows move it. */
const KEY_ZOOM = 0.8;
const KEY_PAN = 0.05;

export interface CurveKeys {
  /** The focus has come to a point. */
  focus: (index: number) => void;
  onPoint: (event: KeyboardEvent, index: number) => void;
  onGround: (event: KeyboardEvent) => void;
  onCopy: (event: ClipboardEvent) => void;
  onCut: (event: ClipboardEvent) => void;
  onPaste: (event: ClipboardEvent) => void;
}

export function useCurveKeys({ plot, points, setWindow, pointerX, busy, onNumbers }: {
  plot: Plot;
  points: readonly TransferFunctionPoint[];
  setWindow: (change: (window: Range) => Range) => void;
  /** Where the pointer is, pixels; null outside. */
  pointerX: number | null;
  /** Whether a pointer is down. */
  busy: () => boolean;
  onNumbers: () => void;
}): CurveKeys {
  // Points have been marked with the space bar: the focus takes the selection no longer along.
  const marking = useRef(false);
  const selected = () => useUi.getState().selectedPoints;

  const nudge = (event: KeyboardEvent): boolean => {
    const ds = { ArrowLeft: -1, ArrowRight: 1 }[event.key] ?? 0;
    const dHeight = { ArrowUp: 1, ArrowDown: -1 }[event.key] ?? 0;
    if ((ds === 0 && dHeight === 0) || selected().length === 0) return false;
    const factor = event.shiftKey ? 10 : 1;
    const step = factor * NUDGE_S * (plot.window[1] - plot.window[0]);
    setPoints(movePoints(points, selected(), ds * step, dHeight * factor * NUDGE_HEIGHT, plot), `nudge-${selected().join("-")}`);
    return true;
  };

  const zoom = (event: KeyboardEvent): boolean => {
    const middle = (plot.window[0] + plot.window[1]) / 2;
    const pan = { ArrowLeft: -KEY_PAN, ArrowRight: KEY_PAN }[event.key];
    if (event.key === "+" || event.key === "=") setWindow((now) => zoomWindow(now, middle, KEY_ZOOM));
    else if (event.key === "-") setWindow((now) => zoomWindow(now, middle, 1 / KEY_ZOOM));
    else if (event.key === "0") setWindow(() => [0, 1]);
    else if (pan !== undefined) setWindow((now) => panWindow(now, pan * (now[1] - now[0])));
    else return false;
    return true;
  };

  /** True where the key did something. */
  const common = (event: KeyboardEvent): boolean => {
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "a") selectAll();
    else if (event.ctrlKey || event.metaKey || event.altKey) return false;
    else if (event.key === "Delete" || event.key === "Backspace") removeSelected();
    else if (event.key === "Insert" || event.key.toLowerCase() === "n") addOnCurve((plot.window[0] + plot.window[1]) / 2);
    else return nudge(event) || zoom(event);
    return true;
  };

  const taken = (event: KeyboardEvent) => {
    event.preventDefault();
    event.stopPropagation();
  };

  return {
    focus: (index) => {
      if (selected().length === 0) marking.current = false;
      if (!busy() && !marking.current && selected().length <= 1) select([index]);
    },
    onPoint: (event, index) => {
      if (event.key === " ") {
        // The first press marks the point that the focus has selected.
        const only = selected().length === 1 && selected()[0] === index;
        if (marking.current || !only) select(withToggled(selected(), index));
        marking.current = true;
      } else if (event.key === "Escape") {
        marking.current = false;
        select([index]);
      } else if (event.key === "Enter") onNumbers();
      else if (!common(event)) return;
      taken(event);
    },
    onGround: (event) => {
      if (event.key === "Escape") {
        marking.current = false;
        select([]);
      } else if (!common(event)) return;
      taken(event);
    },
    onCopy: (event) => {
      event.clipboardData.setData("text/plain", copyText());
      event.preventDefault();
    },
    onCut: (event) => {
      event.clipboardData.setData("text/plain", copyText());
      removeSelected();
      event.preventDefault();
    },
    onPaste: (event) => {
      take(event.clipboardData.getData("text/plain"), pointerX === null ? null : Math.min(1, Math.max(0, sAt(plot, pointerX))));
      event.preventDefault();
    },
  };
}

