/**
 * Pointers on the curve: points and bands are dragged, empty ground draws a rectangle that selects,
 * two fingers zoom the values.
 */

import { useRef, useState, type PointerEvent, type RefObject } from "react";
import { useUi } from "../app/uiStore";
import type { TransferFunctionPoint } from "../generated/proto";
import { session } from "../session/engine";
import { select, setPoints } from "./curve";
import { pointsWithin, sAt, type Plot, type Rubber } from "./geometry";
import { movePoints } from "./points";
import { withToggled, zoomAndPan } from "./selection";
import type { Range } from "./valueAxis";

/** Pixels a drag must go before it is one, and before Shift chooses its axis. */
const SLACK_PIXELS = 3;

interface Drag {
  /** Points that move; empty: a rectangle is drawn. */
  moving: readonly number[];
  /** What a press without a drag selects. */
  pressed: readonly number[];
  /** What was selected before, where the rectangle adds to it. */
  kept: readonly number[];
  /** Where it started, pixels. */
  x: number;
  y: number;
  points: readonly TransferFunctionPoint[];
  lock: "x" | "y" | null;
  moved: boolean;
}

export interface CurveDrag {
  /** The rectangle that is drawn. */
  rubber: Rubber | null;
  grab: (event: PointerEvent, indices: readonly number[]) => void;
  ground: (event: PointerEvent) => void;
  move: (event: PointerEvent) => void;
  release: (event: PointerEvent) => void;
  /** Whether a pointer is down: focus that comes with it selects nothing. */
  busy: () => boolean;
}

const adds = (event: PointerEvent): boolean => event.shiftKey || event.ctrlKey || event.metaKey;

export function useCurveDrag({ svg, plot, points, setWindow, hold }: {
  svg: RefObject<SVGSVGElement | null>;
  plot: Plot;
  points: readonly TransferFunctionPoint[];
  setWindow: (change: (window: Range) => Range) => void;
  /** Points begin to move, or have moved: the axis stays meanwhile. */
  hold: (held: boolean) => void;
}): CurveDrag {
  const drag = useRef<Drag | null>(null);
  const fingers = useRef(new Map<number, number>());
  const [rubber, setRubber] = useState<Rubber | null>(null);
  const place = (event: PointerEvent) => {
    const box = svg.current?.getBoundingClientRect();
    return { x: event.clientX - (box?.left ?? 0), y: event.clientY - (box?.top ?? 0) };
  };

  const stop = () => {
    if (drag.current && drag.current.moving.length > 0) session.endGesture();
    drag.current = null;
    setRubber(null);
    hold(false);
  };

  /** True where a second finger has come: from here on both zoom. */
  const down = (event: PointerEvent): boolean => {
    svg.current?.setPointerCapture(event.pointerId);
    if (event.pointerType === "touch") fingers.current.set(event.pointerId, place(event).x);
    if (fingers.current.size < 2) return false;
    stop();
    return true;
  };

  const grab = (event: PointerEvent, indices: readonly number[]) => {
    if (event.button !== 0) return;
    event.stopPropagation();
    if (down(event)) return;
    const { selectedPoints } = useUi.getState();
    const among = indices.every((index) => selectedPoints.includes(index));
    const toggles = adds(event) && indices.length === 1;
    const moves = among ? selectedPoints : indices;
    drag.current = { moving: moves, pressed: toggles ? withToggled(selectedPoints, indices[0] ?? 0) : indices, kept: [], ...place(event), points, lock: null, moved: false };
    if (!among && !toggles) select(indices);
    session.beginGesture();
  };

  const ground = (event: PointerEvent) => {
    if (event.button !== 0 || down(event)) return;
    const kept = adds(event) ? useUi.getState().selectedPoints : [];
    drag.current = { moving: [], pressed: kept, kept, ...place(event), points, lock: null, moved: false };
  };

  const pinch = (event: PointerEvent): boolean => {
    const { current } = fingers;
    const from = current.get(event.pointerId);
    if (from === undefined || current.size < 2) return false;
    const other = [...current].find(([id]) => id !== event.pointerId)?.[1] ?? from;
    const { x } = place(event);
    current.set(event.pointerId, x);
    setWindow((window) => {
      const now = { ...plot, window };
      return zoomAndPan(window, [sAt(now, other), sAt(now, from)], [(other - plot.left) / plot.width, (x - plot.left) / plot.width]);
    });
    return true;
  };

  const move = (event: PointerEvent) => {
    const held = drag.current;
    if (pinch(event) || !held) return;
    const at = place(event);
    const [dx, dy] = [at.x - held.x, at.y - held.y];
    if (!held.moved && Math.hypot(dx, dy) <= SLACK_PIXELS) return;
    held.moved = true;
    if (held.moving.length === 0) {
      const drawn = { x: held.x, y: held.y, toX: at.x, toY: at.y };
      setRubber(drawn);
      select([...new Set([...held.kept, ...pointsWithin(plot, points, drawn)])].sort((a, b) => a - b));
      return;
    }
    hold(true);
    if (!event.shiftKey) held.lock = null;
    else held.lock ??= Math.abs(dx) > Math.abs(dy) ? "x" : "y";
    const ds = held.lock === "y" ? 0 : (dx / plot.width) * (plot.window[1] - plot.window[0]);
    setPoints(movePoints(held.points, held.moving, ds, held.lock === "x" ? 0 : -dy / plot.height, plot));
  };

  const release = (event: PointerEvent) => {
    fingers.current.delete(event.pointerId);
    if (drag.current && !drag.current.moved && event.type === "pointerup") select(drag.current.pressed);
    stop();
  };

  return { rubber, grab, ground, move, release, busy: () => drag.current !== null };
}
