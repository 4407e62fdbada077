/** A shaded sphere that shows where a light comes from, as the viewer sees it; drag to move it. */

import { useEffect, useRef, type KeyboardEvent, type PointerEvent } from "react";
import type { Triple } from "../scene/vec";
import { session } from "../session/engine";
import { directionAt, directionInWords, placeAt, turned } from "./sphere";

/** CSS pixels: the whole control, and the sphere in its middle. */
const SIZE = 84;
const RADIUS = 27;
const CENTRE = SIZE / 2;
/** The ring of directions from behind is narrower than the sphere's radius. */
const RING = CENTRE - RADIUS - 5;

/** Place in pixels of a place in sphere radii; the ring beyond the rim is drawn narrower. */
function toPixels([x, y]: [number, number]): [number, number] {
  const radius = Math.hypot(x, y);
  const shown = radius <= 1 ? radius * RADIUS : RADIUS + (radius - 1) * RING;
  const k = radius > 0 ? shown / radius : 0;
  return [CENTRE + x * k, CENTRE - y * k];
}

function fromPixels(px: number, py: number): [number, number] {
  const [x, y] = [px - CENTRE, CENTRE - py];
  const shown = Math.hypot(x, y);
  const radius = shown <= RADIUS ? shown / RADIUS : 1 + (shown - RADIUS) / RING;
  const k = shown > 0 ? radius / shown : 0;
  return [x * k, y * k];
}

/** Turn of an arrow key, degrees; Shift takes more. */
const KEY_DEGREES = 2;
const SHIFT_KEY_DEGREES = 15;

export function DirectionSphere({ towards, onChange }: {
  /** Direction towards the light in view axes. */
  towards: Triple;
  onChange: (towards: Triple) => void;
}) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [tx, ty, tz] = towards;

  useEffect(() => {
    const element = canvas.current;
    const context = element?.getContext("2d");
    if (!element || !context) return;
    const ratio = window.devicePixelRatio || 1;
    const edge = Math.round(RADIUS * 2 * ratio);
    element.width = edge;
    element.height = edge;
    const image = context.createImageData(edge, edge);
    for (let row = 0; row < edge; row += 1) {
      for (let column = 0; column < edge; column += 1) {
        const x = ((column + 0.5) / edge) * 2 - 1;
        const y = 1 - ((row + 0.5) / edge) * 2;
        const radius = Math.hypot(x, y);
        const lambert = Math.max(0, x * tx + y * ty + Math.sqrt(Math.max(0, 1 - radius * radius)) * tz);
        const level = 34 + 190 * Math.sqrt(lambert);
        const coverage = Math.min(1, Math.max(0, (1 - radius) * RADIUS * ratio + 0.5));
        image.data.set([level, level, level, coverage * 255], (row * edge + column) * 4);
      }
    }
    context.putImageData(image, 0, 0);
  }, [tx, ty, tz]);

  const drag = (event: PointerEvent<HTMLDivElement>) => {
    if (!event.currentTarget.hasPointerCapture(event.pointerId)) return;
    const box = event.currentTarget.getBoundingClientRect();
    onChange(directionAt(...fromPixels(event.clientX - box.left, event.clientY - box.top)));
  };
  const key = (event: KeyboardEvent) => {
    const step = event.shiftKey ? SHIFT_KEY_DEGREES : KEY_DEGREES;
    const right = { ArrowLeft: -step, ArrowRight: step }[event.key] ?? 0;
    const up = { ArrowUp: step, ArrowDown: -step }[event.key] ?? 0;
    if (right === 0 && up === 0) return;
    event.preventDefault();
    onChange(turned(towards, right, up));
  };
  const [hx, hy] = toPixels(placeAt(towards));
  return (
    <div
      className="direction-sphere"
      style={{ width: SIZE, height: SIZE }}
      title="Drag to turn the light; beyond the rim it comes from behind"
      tabIndex={0}
      role="slider"
      aria-label="Direction of the light"
      aria-valuenow={Math.round(Math.atan2(tx, tz) * (180 / Math.PI))}
      aria-valuemin={-180}
      aria-valuemax={180}
      aria-valuetext={directionInWords(towards)}
      data-testid="light-direction"
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        session.beginGesture();
        drag(event);
      }}
      onPointerMove={drag}
      onPointerUp={() => session.endGesture()}
      onKeyDown={key}
    >
      <canvas ref={canvas} style={{ width: RADIUS * 2, height: RADIUS * 2, left: CENTRE - RADIUS, top: CENTRE - RADIUS }} />
      <span className="direction-handle" data-behind={tz < 0} style={{ left: hx, top: hy }} />
    </div>
  );
}
