/** The curve over the histogram, edited in place. */

import { useElementSize } from "@mantine/hooks";
import { useEffect, useId, useMemo, useRef, useState, type KeyboardEvent, type PointerEvent } from "react";
import { useUi } from "../app/uiStore";
import type { Histogram, TransferFunctionPoint } from "../generated/proto";
import { hexFromLinear } from "../scene/colour";
import { session } from "../session/engine";
import { EditCost } from "./EditCost";
import { areaUnder, bandPath, columnsPath, curvePath, heightAt, opacityAtY, sAt, xOf, yOf, type Plot } from "./geometry";
import { heightOf, opacityAt, opacityOf } from "./opacity";
import { addPoint, moveBand, movePoint, opacityAtValue, removePoint } from "./points";
import { formatData, formatValue, histogramColumns, panWindow, ticks, valueOf, zoomWindow, type Range } from "./valueAxis";

const PLOT_HEIGHT = 148;
/** The strip of edit costs under the plot, and the gap above it. */
const COST_GAP = 3;
const COST_HEIGHT = 6;
const AXIS_TOP = PLOT_HEIGHT + COST_GAP + COST_HEIGHT + 1;
const AXIS_HEIGHT = 20;
const MARGIN = 8;
/** Labels of the axis closer than this to an end grow inwards, pixels. */
const EDGE = 14;
/** Nudge of an arrow key: shares of the value window and of the opacity axis; Shift takes ten. */
const NUDGE_S = 1 / 400;
const NUDGE_HEIGHT = 1 / 200;
/** Pixels a drag with Shift must go before its axis is chosen. */
const LOCK_PIXELS = 3;
const WHEEL_ZOOM_PER_PIXEL = 0.002;

interface Drag {
  kind: "point" | "band";
  index: number;
  /** Where it started, pixels. */
  x: number;
  y: number;
  points: readonly TransferFunctionPoint[];
  lock: "x" | "y" | null;
}

export const setPoints = (points: TransferFunctionPoint[], key: string | null = null): void =>
  session.edit({ transfer_function: { points } }, key);

export function Editor({ points, histogram, shown, range, whole, onNumbers }: {
  points: readonly TransferFunctionPoint[];
  /** Of the whole volume. */
  histogram: Histogram | null;
  /** What of it is drawn behind the curve. */
  shown: Pick<Histogram, "counts" | "value_range"> | null;
  /** Data values of `s` = 0 and 1. */
  range: Range;
  /** Values are whole numbers. */
  whole: boolean;
  /** Exact numbers of the selected point are wanted. */
  onNumbers: () => void;
}) {
  const { ref: frame, width } = useElementSize<HTMLDivElement>();
  const svg = useRef<SVGSVGElement>(null);
  const drag = useRef<Drag | null>(null);
  const [window, setWindow] = useState<Range>([0, 1]);
  const [pointer, setPointer] = useState<{ x: number; y: number } | null>(null);
  const selected = useUi((ui) => ui.selectedPoint);
  const axis = useUi((ui) => ui.opacityAxis);
  const log = useUi((ui) => ui.logHistogram);
  const id = useId();

  const plot: Plot = useMemo(
    () => ({ left: MARGIN, top: MARGIN, width: Math.max(1, width - 2 * MARGIN), height: PLOT_HEIGHT - MARGIN, window, axis }),
    [width, window, axis],
  );
  const select = (index: number | null) => useUi.setState({ selectedPoint: index });
  const place = (event: { clientX: number; clientY: number }) => {
    const box = svg.current?.getBoundingClientRect();
    return { x: event.clientX - (box?.left ?? 0), y: event.clientY - (box?.top ?? 0) };
  };

  // React listens to the wheel passively; zooming must keep the panel from scrolling.
  useEffect(() => {
    const element = svg.current;
    if (!element) return;
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      const x = event.clientX - element.getBoundingClientRect().left;
      const sideways = event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY);
      setWindow((now) => {
        const shown = { ...plot, window: now };
        const amount = event.deltaX || event.deltaY;
        if (sideways) return panWindow(now, (amount / plot.width) * (now[1] - now[0]));
        return zoomWindow(now, sAt(shown, x), Math.exp(event.deltaY * WHEEL_ZOOM_PER_PIXEL));
      });
    };
    element.addEventListener("wheel", wheel, { passive: false });
    return () => element.removeEventListener("wheel", wheel);
  }, [plot]);

  const grab = (event: PointerEvent, kind: Drag["kind"], index: number) => {
    if (event.button !== 0) return;
    event.stopPropagation();
    svg.current?.setPointerCapture(event.pointerId);
    drag.current = { kind, index, ...place(event), points, lock: null };
    if (kind === "point") select(index);
    session.beginGesture();
  };

  const move = (event: PointerEvent) => {
    const at = place(event);
    setPointer(at);
    const held = drag.current;
    if (!held) return;
    const dx = at.x - held.x;
    const dy = at.y - held.y;
    if (!event.shiftKey) held.lock = null;
    else if (!held.lock && Math.hypot(dx, dy) > LOCK_PIXELS) held.lock = Math.abs(dx) > Math.abs(dy) ? "x" : "y";
    const ds = held.lock === "y" ? 0 : (dx / plot.width) * (plot.window[1] - plot.window[0]);
    const dHeight = held.lock === "x" ? 0 : -dy / plot.height;
    const point = held.points[held.index];
    if (!point || (dx === 0 && dy === 0)) return;
    if (held.kind === "band") setPoints(moveBand(held.points, held.index, ds, dHeight, axis));
    else setPoints(movePoint(held.points, held.index, point.s + ds, dHeight === 0 ? null : opacityAt(heightOf(opacityOf(point), axis) + dHeight, axis)));
  };

  const release = () => {
    if (drag.current) session.endGesture();
    drag.current = null;
  };

  const nudge = (event: KeyboardEvent, index: number) => {
    const point = points[index];
    if (!point) return;
    const factor = event.shiftKey ? 10 : 1;
    const ds = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const dHeight = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (ds !== undefined) {
      setPoints(movePoint(points, index, point.s + ds * factor * NUDGE_S * (plot.window[1] - plot.window[0]), null), `nudge-${index}`);
    } else if (dHeight !== undefined) {
      setPoints(movePoint(points, index, point.s, opacityAt(heightOf(opacityOf(point), axis) + dHeight * factor * NUDGE_HEIGHT, axis)), `nudge-${index}`);
    } else if (event.key === "Delete" || event.key === "Backspace") {
      setPoints(removePoint(points, index));
      select(null);
    } else if (event.key === "Enter") {
      onNumbers();
    } else return;
    event.preventDefault();
    event.stopPropagation();
  };

  const add = (event: { clientX: number; clientY: number }) => {
    const { x, y } = place(event);
    if (y > PLOT_HEIGHT) {
      setWindow([0, 1]);
      return;
    }
    const added = addPoint(points, Math.min(1, Math.max(0, sAt(plot, x))), opacityAtY(plot, y));
    if (added.index < 0) return;
    setPoints(added.points);
    select(added.index);
  };

  const curve = curvePath(plot, points);
  const columns = useMemo(() => {
    if (!shown || width === 0) return "";
    const values: Range = [valueOf(window[0], range), valueOf(window[1], range)];
    return columnsPath(plot, histogramColumns(shown, values, Math.max(1, Math.floor(plot.width / 1.5)), log));
  }, [shown, plot, range, window, log, width]);
  const values: Range = [valueOf(window[0], range), valueOf(window[1], range)];
  const floor = plot.top + plot.height;

  return (
    <div ref={frame}>
      <svg
        ref={svg}
        className="tf"
        height={AXIS_TOP + AXIS_HEIGHT}
        data-testid="tf-editor"
        data-window={window.join(" ")}
        onPointerMove={move}
        onPointerUp={release}
        onPointerCancel={release}
        onPointerLeave={() => setPointer(null)}
        onDoubleClick={add}
        onContextMenu={(event) => event.preventDefault()}
      >
        <defs>
          <clipPath id={`${id}-clip`}><rect x={plot.left} y={0} width={plot.width} height={floor + 1} /></clipPath>
          <linearGradient id={`${id}-colour`} gradientUnits="userSpaceOnUse" x1={xOf(plot, 0)} x2={xOf(plot, 1)}>
            {points.map((point, index) => <stop key={index} offset={point.s} stopColor={hexFromLinear(point.albedo)} />)}
          </linearGradient>
        </defs>
        <rect className="tf-ground" x={plot.left} y={plot.top} width={plot.width} height={plot.height} />
        <path className="tf-histogram" d={columns} data-testid="tf-histogram" />
        {[0.25, 0.5, 0.75].map((height) => <line key={height} className="tf-grid" x1={plot.left} x2={plot.left + plot.width} y1={floor - height * plot.height} y2={floor - height * plot.height} />)}
        <g clipPath={`url(#${id}-clip)`}>
          <path d={areaUnder(plot, curve)} fill={`url(#${id}-colour)`} className="tf-area" />
          {points.slice(1).map((to, index) => {
            const from = points[index];
            return from && to.s > from.s && (
              <path key={index} className="tf-band" d={bandPath(plot, from, to)} data-testid={`tf-band-${index}`} onPointerDown={(event) => grab(event, "band", index)} />
            );
          })}
          <path className="tf-curve-edge" d={curve} />
          <path className="tf-curve" d={curve} />
        </g>
        {histogram && width > 0 && <EditCost plot={plot} y={PLOT_HEIGHT + COST_GAP} height={COST_HEIGHT} histogram={histogram} range={range} whole={whole} pointerX={pointer?.x ?? null} />}
        <g className="tf-axis">
          {ticks(values, 5).map((value) => {
            const x = plot.left + ((value - values[0]) / (values[1] - values[0])) * plot.width;
            return (
              <g key={value}>
                <line x1={x} x2={x} y1={AXIS_TOP} y2={AXIS_TOP + 4} />
                <text x={x} y={AXIS_TOP + 15} textAnchor={x < plot.left + EDGE ? "start" : x > plot.left + plot.width - EDGE ? "end" : "middle"}>{formatValue(value)}</text>
              </g>
            );
          })}
          <rect className="tf-axis-hit" x={0} y={AXIS_TOP} width={width} height={AXIS_HEIGHT} data-testid="tf-axis" />
        </g>
        {points.map((point, index) => {
          const x = xOf(plot, point.s);
          if (x < plot.left - 1 || x > plot.left + plot.width + 1) return null;
          const value = valueOf(point.s, range);
          return (
            <circle
              key={index}
              className="tf-point"
              cx={x}
              cy={yOf(plot, opacityOf(point))}
              r={index === selected ? 6.5 : 5}
              fill={hexFromLinear(point.albedo)}
              tabIndex={0}
              role="slider"
              aria-label={`Point ${index + 1}`}
              aria-valuenow={value}
              aria-valuetext={`value ${formatData(value, whole)}, opacity ${opacityOf(point).toFixed(3)}`}
              data-testid={`tf-point-${index}`}
              data-selected={index === selected}
              data-s={point.s}
              data-opacity={opacityOf(point)}
              onPointerDown={(event) => grab(event, "point", index)}
              onFocus={() => select(index)}
              onKeyDown={(event) => nudge(event, index)}
              onDoubleClick={(event) => event.stopPropagation()}
              onContextMenu={(event) => {
                event.preventDefault();
                select(index);
                onNumbers();
              }}
            />
          );
        })}
        {pointer && pointer.y <= floor && (
          <text className="tf-readout" x={plot.left + plot.width - 4} y={plot.top + 11}>
            {formatData(valueOf(sAt(plot, pointer.x), range), whole)} · {(drag.current ? opacityAt(heightAt(plot, pointer.y), axis) : opacityAtValue(points, sAt(plot, pointer.x))).toFixed(3)}
          </text>
        )}
      </svg>
    </div>
  );
}
