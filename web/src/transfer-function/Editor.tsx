/** The curve over the histogram, edited in place. */

import { useElementSize } from "@mantine/hooks";
import { useCallback, useEffect, useId, useMemo, useRef, useState } from "react";
import { useUi } from "../app/uiStore";
import type { Histogram, TransferFunctionPoint } from "../generated/proto";
import { hexFromLinear } from "../scene/colour";
import { useSession } from "../session/store";
import { select, setPoints } from "./curve";
import { CurvePoints } from "./CurvePoints";
import { EditCost } from "./EditCost";
import { sharesOf } from "./editCost";
import { areaUnder, bandPath, ceilingFor, columnsPath, curvePath, opacityAtY, sAt, xOf, type Plot } from "./geometry";
import { addPoint, opacityAtValue } from "./points";
import { useCurveDrag } from "./useCurveDrag";
import { useCurveKeys } from "./useCurveKeys";
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
const WHEEL_ZOOM_PER_PIXEL = 0.002;

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
  const stale = useSession(({ scene, staleShares }) => sharesOf(scene?.illumination.method, staleShares));
  const { ref: frame, width } = useElementSize<HTMLDivElement>();
  const svg = useRef<SVGSVGElement>(null);
  const [window, setWindow] = useState<Range>([0, 1]);
  const [pointer, setPointer] = useState<{ x: number; y: number } | null>(null);
  // While points move the axis stays as it was.
  const [heldCeiling, setHeldCeiling] = useState<number | null>(null);
  const axis = useUi((ui) => ui.opacityAxis);
  const log = useUi((ui) => ui.logHistogram);
  const id = useId();

  const ceiling = heldCeiling ?? ceilingFor(points, window);
  const plot: Plot = useMemo(
    () => ({ left: MARGIN, top: MARGIN, width: Math.max(1, width - 2 * MARGIN), height: PLOT_HEIGHT - MARGIN, window, axis, ceiling }),
    [width, window, axis, ceiling],
  );
  const hold = useCallback((held: boolean) => setHeldCeiling(held ? ceiling : null), [ceiling]);
  const drag = useCurveDrag({ svg, plot, points, setWindow, hold });
  const keys = useCurveKeys({ plot, points, setWindow, pointerX: pointer?.x ?? null, busy: drag.busy, onNumbers });
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
        const amount = event.deltaX || event.deltaY;
        if (sideways) return panWindow(now, (amount / plot.width) * (now[1] - now[0]));
        return zoomWindow(now, sAt({ ...plot, window: now }, x), Math.exp(event.deltaY * WHEEL_ZOOM_PER_PIXEL));
      });
    };
    element.addEventListener("wheel", wheel, { passive: false });
    return () => element.removeEventListener("wheel", wheel);
  }, [plot]);

  const add = (event: { clientX: number; clientY: number }) => {
    const { x, y } = place(event);
    if (y > PLOT_HEIGHT) {
      setWindow([0, 1]);
      return;
    }
    const added = addPoint(points, Math.min(1, Math.max(0, sAt(plot, x))), opacityAtY(plot, y));
    if (added.index < 0) return;
    setPoints(added.points);
    select([added.index]);
  };

  const curve = curvePath(plot, points);
  const columns = useMemo(() => {
    if (!shown || width === 0) return "";
    const values: Range = [valueOf(window[0], range), valueOf(window[1], range)];
    return columnsPath(plot, histogramColumns(shown, values, Math.max(1, Math.floor(plot.width / 1.5)), log));
  }, [shown, plot, range, window, log, width]);
  const floor = plot.top + plot.height;
  const { rubber } = drag;

  return (
    <div ref={frame} onCopy={keys.onCopy} onCut={keys.onCut} onPaste={keys.onPaste}>
      <svg
        ref={svg}
        className="tf"
        height={AXIS_TOP + AXIS_HEIGHT}
        tabIndex={0}
        role="group"
        aria-label="Transfer function: opacity over data values"
        data-testid="tf-editor"
        data-window={window.join(" ")}
        data-ceiling={ceiling}
        onPointerDown={drag.ground}
        onPointerMove={(event) => {
          setPointer(place(event));
          drag.move(event);
        }}
        onPointerUp={drag.release}
        onPointerCancel={drag.release}
        onPointerLeave={() => setPointer(null)}
        onDoubleClick={add}
        onKeyDown={keys.onGround}
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
              <path key={index} className="tf-band" d={bandPath(plot, from, to)} data-testid={`tf-band-${index}`} onPointerDown={(event) => {
                // With Ctrl the band is ground, too: a rectangle may begin in it.
                if (!event.ctrlKey && !event.metaKey) drag.grab(event, [index, index + 1]);
              }} />
            );
          })}
          <path className="tf-curve-edge" d={curve} />
          <path className="tf-curve" d={curve} />
        </g>
        {histogram && width > 0 && <EditCost plot={plot} y={PLOT_HEIGHT + COST_GAP} height={COST_HEIGHT} histogram={histogram} stale={stale} range={range} whole={whole} pointerX={pointer?.x ?? null} />}
        <ValueAxis plot={plot} width={width} range={range} />
        {ceiling < 1 && <text className="tf-ceiling" x={plot.left + 4} y={plot.top + 11} data-testid="tf-ceiling">opacity to {formatValue(ceiling)}</text>}
        <CurvePoints plot={plot} points={points} range={range} whole={whole} drag={drag} onFocus={keys.focus} onKeyDown={keys.onPoint} onMenu={(index) => {
          select([index]);
          onNumbers();
        }} />
        {rubber && <rect className="tf-rubber" data-testid="tf-rubber" x={Math.min(rubber.x, rubber.toX)} y={Math.min(rubber.y, rubber.toY)} width={Math.abs(rubber.toX - rubber.x)} height={Math.abs(rubber.toY - rubber.y)} />}
        {pointer && !rubber && pointer.y <= floor && (
          <text className="tf-readout" x={plot.left + plot.width - 4} y={plot.top + 11}>
            {formatData(valueOf(sAt(plot, pointer.x), range), whole)} · {(heldCeiling !== null ? opacityAtY(plot, pointer.y) : opacityAtValue(points, sAt(plot, pointer.x))).toFixed(3)}
          </text>
        )}
      </svg>
    </div>
  );
}

/** Data values under the plot; a double press on it shows all of them. */
function ValueAxis({ plot, width, range }: { plot: Plot; width: number; range: Range }) {
  const values: Range = [valueOf(plot.window[0], range), valueOf(plot.window[1], range)];
  return (
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
  );
}
