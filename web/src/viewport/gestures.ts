/** Pointer, touch and wheel on the picture, turned into camera moves. */

import type { Camera } from "../generated/proto";
import type { Triple } from "../scene/vec";
import { nearestAxis, orbit, pan, zoom } from "./camera";

/** A drag over the viewport's whole height turns by this, radians. */
const ORBIT_PER_HEIGHT = Math.PI;
/** Zoom per pixel of a right drag and per pixel of the wheel, natural logarithm of the factor. */
const DRAG_ZOOM_PER_PIXEL = 0.006;
const WHEEL_ZOOM_PER_PIXEL = 0.0015;
/** Pixels of a wheel that counts in lines and in pages. */
const WHEEL_LINE_PIXELS = 16;
const WHEEL_PAGE_PIXELS = 400;

/** What gestures act on. */
export interface View {
  camera: () => Camera | null;
  /** Up direction of the starting camera: the turntable's axis is the nearest world axis. */
  startUp: () => Triple;
  move: (camera: Camera) => void;
  /** Window and level, where plain drags are for them. */
  window: {
    active: () => boolean;
    begin: () => void;
    /** In shares of the viewport, upwards counted positive. */
    move: (right: number, up: number) => void;
    end: () => void;
  };
}

type Mode = "orbit" | "pan" | "zoom" | "window";

interface Point {
  x: number;
  y: number;
}

/** Listens on `element` until the returned function is called. */
export function attachGestures(element: HTMLElement, view: View): () => void {
  const pointers = new Map<number, Point>();
  let mode: Mode = "orbit";
  let grabbed: Point = { x: 0, y: 0 };

  const change = (step: (camera: Camera) => Camera) => {
    const camera = view.camera();
    if (camera) view.move(step(camera));
  };
  /** From the viewport's centre in viewport heights, y upwards. */
  const place = ({ x, y }: Point): [number, number] => {
    const box = element.getBoundingClientRect();
    return [(x - box.left - box.width / 2) / box.height, -(y - box.top - box.height / 2) / box.height];
  };

  const drag = (by: Point) => {
    const height = element.clientHeight;
    const dx = by.x / height;
    const dy = by.y / height;
    if (mode === "window") view.window.move(by.x / element.clientWidth, -dy);
    else if (mode === "orbit") change((camera) => orbit(camera, dx * ORBIT_PER_HEIGHT, dy * ORBIT_PER_HEIGHT, nearestAxis(view.startUp())));
    else if (mode === "pan") change((camera) => pan(camera, dx, dy));
    else change((camera) => zoom(camera, Math.exp(by.y * DRAG_ZOOM_PER_PIXEL), ...place(grabbed)));
  };

  /** Two fingers: their middle pans, their distance zooms about it. */
  const pinch = (id: number, to: Point) => {
    const from = pointers.get(id);
    const other = [...pointers].find(([key]) => key !== id)?.[1];
    if (!from || !other) return;
    const spread = (a: Point) => Math.max(8, Math.hypot(a.x - other.x, a.y - other.y));
    const height = element.clientHeight;
    const middle = { x: (to.x + other.x) / 2, y: (to.y + other.y) / 2 };
    change((camera) => zoom(
      pan(camera, (to.x - from.x) / 2 / height, (to.y - from.y) / 2 / height), spread(from) / spread(to), ...place(middle),
    ));
  };

  const down = (event: PointerEvent) => {
    if (event.target !== element) return;
    element.setPointerCapture(event.pointerId);
    element.focus({ preventScroll: true });
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    grabbed = { x: event.clientX, y: event.clientY };
    if (event.button === 2) mode = "zoom";
    else mode = event.button === 1 || event.shiftKey ? "pan" : view.window.active() !== event.ctrlKey ? "window" : "orbit";
    // A second finger pinches: the window stays as it is.
    if (mode === "window" && pointers.size === 1) view.window.begin();
    element.dataset.gesture = mode;
    if (event.button === 1) event.preventDefault();
  };
  const moved = (event: PointerEvent) => {
    const from = pointers.get(event.pointerId);
    if (!from) return;
    const to = { x: event.clientX, y: event.clientY };
    if (pointers.size >= 2) pinch(event.pointerId, to);
    else drag({ x: to.x - from.x, y: to.y - from.y });
    pointers.set(event.pointerId, to);
  };
  const up = (event: PointerEvent) => {
    pointers.delete(event.pointerId);
    if (pointers.size > 0) return;
    delete element.dataset.gesture;
    if (mode === "window") view.window.end();
    mode = "orbit";
  };
  const wheel = (event: WheelEvent) => {
    event.preventDefault();
    const unit = [1, WHEEL_LINE_PIXELS, WHEEL_PAGE_PIXELS][event.deltaMode] ?? 1;
    change((camera) => zoom(camera, Math.exp(event.deltaY * unit * WHEEL_ZOOM_PER_PIXEL), ...place({ x: event.clientX, y: event.clientY })));
  };
  const noMenu = (event: Event) => event.preventDefault();

  const listening = new AbortController();
  const { signal } = listening;
  element.addEventListener("pointerdown", down, { signal });
  element.addEventListener("pointermove", moved, { signal });
  element.addEventListener("pointerup", up, { signal });
  element.addEventListener("pointercancel", up, { signal });
  element.addEventListener("lostpointercapture", up, { signal });
  element.addEventListener("wheel", wheel, { signal, passive: false });
  element.addEventListener("contextmenu", noMenu, { signal });
  return () => listening.abort();
}
