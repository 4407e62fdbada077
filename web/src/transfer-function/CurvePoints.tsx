/** The handles of the curve. */

import type { KeyboardEvent } from "react";
import { useUi } from "../app/uiStore";
import type { TransferFunctionPoint } from "../generated/proto";
import { hexFromLinear } from "../scene/colour";
import { xOf, yOf, type Plot } from "./geometry";
import { opacityOf } from "./opacity";
import type { CurveDrag } from "./useCurveDrag";
import { formatData, valueOf, type Range } from "./valueAxis";

export function CurvePoints({ plot, points, range, whole, drag, onFocus, onKeyDown, onMenu }: {
  plot: Plot;
  points: readonly TransferFunctionPoint[];
  /** Data values of `s` = 0 and 1. */
  range: Range;
  whole: boolean;
  drag: CurveDrag;
  onFocus: (index: number) => void;
  onKeyDown: (event: KeyboardEvent, index: number) => void;
  onMenu: (index: number) => void;
}) {
  const selected = useUi((ui) => ui.selectedPoints);
  return points.map((point, index) => {
    const x = xOf(plot, point.s);
    if (x < plot.left - 1 || x > plot.left + plot.width + 1) return null;
    const y = Math.max(plot.top, yOf(plot, opacityOf(point)));
    const isSelected = selected.includes(index);
    return (
      <g key={index} data-point={index} onPointerDown={(event) => drag.grab(event, [index])}>
        <circle className="tf-point-reach" cx={x} cy={y} />
        <circle
          className="tf-point"
          cx={x}
          cy={y}
          r={isSelected ? 6.5 : 5}
          fill={hexFromLinear(point.albedo)}
          tabIndex={0}
          role="slider"
          aria-label={`Point ${index + 1}${isSelected ? ", selected" : ""}`}
          aria-valuenow={valueOf(point.s, range)}
          aria-valuemin={range[0]}
          aria-valuemax={range[1]}
          aria-valuetext={`value ${formatData(valueOf(point.s, range), whole)}, opacity ${opacityOf(point).toFixed(3)}`}
          data-testid={`tf-point-${index}`}
          data-selected={isSelected}
          data-s={point.s}
          data-opacity={opacityOf(point)}
          onFocus={() => onFocus(index)}
          onKeyDown={(event) => onKeyDown(event, index)}
          onDoubleClick={(event) => event.stopPropagation()}
          onContextMenu={(event) => {
            event.preventDefault();
            onMenu(index);
          }}
        />
      </g>
    );
  });
}
