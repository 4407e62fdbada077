/** A strip under the curve: what an edit at each value makes be computed again, or touches. */

import { Tooltip } from "@mantine/core";
import { useMemo } from "react";
import type { Histogram, StaleShares } from "../generated/proto";
import { costBins, costInWords, costRuns, stripInWords, strengthOf } from "./editCost";
import { sAt, type Plot } from "./geometry";
import { formatData, valueOf, type Range } from "./valueAxis";

export function EditCost({ plot, y, height, histogram, stale, range, whole, pointerX }: {
  plot: Plot;
  /** Upper edge and height of the strip, pixels. */
  y: number;
  height: number;
  /** Of the whole volume. */
  histogram: Histogram;
  /** What is kept that edits make stale; null where it is not known. */
  stale: StaleShares | null;
  /** Data values of `s` = 0 and 1. */
  range: Range;
  whole: boolean;
  /** Where the pointer is in the editor; null outside. */
  pointerX: number | null;
}) {
  const bins = useMemo(() => costBins(histogram, stale), [histogram, stale]);
  // One column a pixel.
  const columns = Math.max(1, Math.floor(plot.width));
  const runs = useMemo(
    () => costRuns(bins, [valueOf(plot.window[0], range), valueOf(plot.window[1], range)], columns),
    [bins, plot.window, range, columns],
  );
  const columnWidth = plot.width / columns;
  const x = pointerX ?? plot.left;
  const here = runs.find((run) => x < plot.left + run.to * columnWidth) ?? { share: 0, ofVolume: 0 };
  return (
    <g data-testid="tf-edit-cost" data-of={stale?.what ?? "volume"}>
      <rect className="tf-cost-ground" x={plot.left} y={y} width={plot.width} height={height} />
      {runs.map((run) => run.share > 0 && (
        <rect key={run.from} className="tf-cost-bin" x={plot.left + run.from * columnWidth} y={y} width={(run.to - run.from) * columnWidth} height={height} opacity={strengthOf(run.share)} data-share={run.share} />
      ))}
      <Tooltip.Floating position="bottom" offset={26} label={`${formatData(valueOf(sAt(plot, x), range), whole)}: an edit at this value ${costInWords(here, stale)}`}>
        <rect className="tf-cost-hit" x={plot.left} y={y - 1} width={plot.width} height={height + 2} role="img" aria-label={stripInWords(stale)} data-share={here.share} data-testid="tf-edit-cost-hit" />
      </Tooltip.Floating>
    </g>
  );
}
