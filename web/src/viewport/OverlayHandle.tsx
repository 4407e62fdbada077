/** A handle over the picture: dragged by mouse or finger, moved by arrow keys. One drag is one undo step. */

import { useRef, type KeyboardEvent, type PointerEvent } from "react";
import { session } from "../session/engine";
import type { Place } from "./screen";

/** A drag: how far the pointer has gone since it began, CSS pixels. */
export type Dragging = (dx: number, dy: number, shift: boolean) => void;

/** Steps of an arrow key with Shift. */
const SHIFT_STEPS = 10;

export function OverlayHandle({ at, label, text, value, range = [-1, 1], kind, fill, grab, released, nudge, testId }: {
  at: Place;
  label: string;
  /** The value in words. */
  text: string;
  value: number;
  range?: readonly [number, number];
  /** How it looks. */
  kind: "light" | "aim" | "face" | "face-behind" | "plane";
  fill?: string;
  /** A drag begins: returns what it does. */
  grab: () => Dragging;
  /** The drag is over. */
  released?: () => void;
  /** Arrow keys: steps to the right and upwards. */
  nudge: (right: number, up: number) => void;
  testId: string;
}) {
  const held = useRef<{ x: number; y: number; drag: Dragging } | null>(null);
  const end = () => {
    held.current = null;
    session.endGesture();
    released?.();
  };
  const key = (event: KeyboardEvent) => {
    const step = event.shiftKey ? SHIFT_STEPS : 1;
    const right = { ArrowLeft: -step, ArrowRight: step }[event.key] ?? 0;
    const up = { ArrowUp: step, ArrowDown: -step }[event.key] ?? 0;
    if (right === 0 && up === 0) return;
    event.preventDefault();
    nudge(right, up);
  };
  return (
    <div
      className="overlay-handle"
      data-kind={kind}
      style={{ left: at.x, top: at.y, ...(fill === undefined ? {} : { background: fill }) }}
      tabIndex={0}
      role="slider"
      aria-label={label}
      aria-valuenow={value}
      aria-valuemin={range[0]}
      aria-valuemax={range[1]}
      aria-valuetext={text}
      title={label}
      data-testid={testId}
      onPointerDown={(event: PointerEvent<HTMLDivElement>) => {
        if (event.button !== 0) return;
        event.currentTarget.setPointerCapture(event.pointerId);
        held.current = { x: event.clientX, y: event.clientY, drag: grab() };
        session.beginGesture();
      }}
      onPointerMove={(event) => {
        const { current } = held;
        current?.drag(event.clientX - current.x, event.clientY - current.y, event.shiftKey);
      }}
      onPointerUp={end}
      onPointerCancel={end}
      onKeyDown={key}
    />
  );
}
