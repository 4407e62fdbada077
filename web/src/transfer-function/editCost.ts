/** What an edit at a value touches: the share of the volume in which the value's bin occurs. */

import type { Histogram } from "../generated/proto";
import type { Range } from "./valueAxis";

/** A scalar bin that can be seen on the value axis. */
export interface CostBin {
  /** Data values. */
  low: number;
  high: number;
  /** Of the volume, 0..1. */
  share: number;
}

/** Shares below this are too small for a number. */
const LEAST_PERCENT = 0.1;

/**
 * The bins in the order of their values. Data of few values leaves bins without width at the end:
 * only the last of them holds a value, the largest.
 */
export function costBins({ bin_edges: edges, bin_shares: shares }: Histogram): CostBin[] {
  return shares.flatMap((share, bin) => {
    const [low, high] = [edges[bin], edges[bin + 1]];
    if (low === undefined || high === undefined) return [];
    return high > low || bin === shares.length - 1 ? [{ low, high, share }] : [];
  });
}

/** Neighbouring columns of the strip with one share. */
export interface CostRun {
  /** Columns, the last excluded. */
  from: number;
  to: number;
  share: number;
}

/**
 * The strip over a window of data values, in `columns` equal columns: of the bins that a column
 * touches, the share of the one that costs most, so that a narrow bin is not lost. Values that the
 * data does not have touch nothing.
 */
export function costRuns(bins: readonly CostBin[], [low, high]: Range, columns: number): CostRun[] {
  const runs: CostRun[] = [];
  for (let column = 0; column < columns; column += 1) {
    const from = low + ((high - low) * column) / columns;
    const to = low + ((high - low) * (column + 1)) / columns;
    // A bin begins with its lower value; without width it is that value.
    const touched = bins.filter((bin) => bin.low < to && (bin.high > from || bin.low >= from) || (bin.high === to && column === columns - 1));
    const share = touched.reduce((most, bin) => Math.max(most, bin.share), 0);
    const before = runs.at(-1);
    if (before?.share === share) before.to = column + 1;
    else runs.push({ from: column, to: column + 1, share });
  }
  return runs;
}

/** How strongly a share is drawn, 0..1: the square root, so that one percent is still seen. */
export const strengthOf = (share: number): number => Math.sqrt(share);

/** A share in words. */
export function shareInWords(share: number): string {
  const percent = share * 100;
  if (percent === 0) return "nothing";
  if (percent < LEAST_PERCENT) return `less than ${LEAST_PERCENT} % of the volume`;
  if (percent < 10) return `${Number(percent.toFixed(1))} % of the volume`;
  return share === 1 ? "the whole volume" : `${Math.min(99, Math.round(percent))} % of the volume`;
}
