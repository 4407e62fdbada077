/** The value under the pointer, and a measured distance, over the picture. */

import { useEffect, type RefObject } from "react";
import { useSession } from "../session/store";
import { formatValue } from "../transfer-function/valueAxis";
import { distance, hover, leave, measureAt, middle, pivotAt, useProbing, type Pixel } from "./probing";
import { unitsPerWorld } from "./scaleBar";
import { seenAt } from "./screen";

/** The pointer rests this long before its place is asked for, milliseconds. */
const REST_MILLIS = 90;
/** A press that moves less than this is a click, CSS pixels. */
const CLICK_SLACK = 4;

export function ProbeLayer({ canvas, viewport }: { canvas: RefObject<HTMLCanvasElement | null>; viewport: { width: number; height: number } }) {
  const measuring = useProbing((probing) => probing.measuring);

  useEffect(() => {
    const element = canvas.current;
    if (!element) return;
    let rest = 0;
    let pressed: { x: number; y: number } | null = null;
    const pixelOf = (event: MouseEvent): Pixel => {
      const box = element.getBoundingClientRect();
      return { x: event.clientX - box.left, y: event.clientY - box.top, width: box.width, height: box.height };
    };
    const stop = () => {
      window.clearTimeout(rest);
      leave();
    };
    const move = (event: PointerEvent) => {
      window.clearTimeout(rest);
      if (event.buttons === 0 && event.pointerType !== "touch") rest = window.setTimeout(() => hover(pixelOf(event)), REST_MILLIS);
    };
    const press = (event: PointerEvent) => {
      pressed = event.button === 0 ? { x: event.clientX, y: event.clientY } : null;
      stop();
    };
    const release = (event: PointerEvent) => {
      const still = pressed && Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) < CLICK_SLACK;
      pressed = null;
      if (still && measuring) void measureAt(pixelOf(event));
    };
    const twice = (event: MouseEvent) => {
      if (!measuring) void pivotAt(pixelOf(event));
    };
    element.addEventListener("pointermove", move);
    element.addEventListener("pointerdown", press);
    element.addEventListener("pointerup", release);
    element.addEventListener("pointerleave", stop);
    element.addEventListener("wheel", stop, { passive: true });
    element.addEventListener("dblclick", twice);
    return () => {
      stop();
      element.removeEventListener("pointermove", move);
      element.removeEventListener("pointerdown", press);
      element.removeEventListener("pointerup", release);
      element.removeEventListener("pointerleave", stop);
      element.removeEventListener("wheel", stop);
      element.removeEventListener("dblclick", twice);
    };
  }, [canvas, measuring]);

  return (
    <>
      <Distance viewport={viewport} />
      <Readout />
    </>
  );
}

function Readout() {
  const hit = useProbing((probing) => probing.hit);
  const measuring = useProbing((probing) => probing.measuring);
  const ends = useProbing((probing) => probing.ends.length);
  const hint = measuring && ends < 2 ? `Measure: press the ${ends === 0 ? "first" : "second"} place` : null;
  if (!hit && !hint) return null;
  return (
    <div className="probe-readout number" data-testid="probe">
      {hint && <span>{hint}</span>}
      {hit && <span data-testid="probe-value">{formatValue(hit.value)}</span>}
      {hit && <span className="probe-voxel" title="Voxel along x, y, z">{hit.voxel.join(", ")}</span>}
    </div>
  );
}

function Distance({ viewport }: { viewport: { width: number; height: number } }) {
  const ends = useProbing((probing) => probing.ends);
  const camera = useSession((state) => state.scene?.camera);
  const dataset = useSession((state) => state.dataset);
  const spacing = useSession((state) => state.scene?.spacing);
  const [from, to] = ends;
  if (!camera || !from) return null;
  const seen = (point: typeof from) => seenAt(camera, viewport, point);
  const a = seen(from);
  const b = to ? seen(to) : a;
  const label = to ? seen(middle(from, to)) : null;
  if (!a || !b) return null;
  const units = unitsPerWorld(dataset, spacing);
  const unit = dataset?.spacing_unit ?? "";
  return (
    <svg className="probe-distance" width={viewport.width} height={viewport.height} aria-hidden="true" data-testid="distance">
      <line x1={a.x} y1={a.y} x2={b.x} y2={b.y} />
      <circle cx={a.x} cy={a.y} r={3} />
      <circle cx={b.x} cy={b.y} r={3} />
      {to && label && (
        <text x={label.x + 8} y={label.y - 8} data-testid="distance-label">
          {units === null ? `${distance(from, to, 1).toPrecision(3)} of the longest edge` : `${distance(from, to, units).toPrecision(4)} ${unit}`}
        </text>
      )}
    </svg>
  );
}
