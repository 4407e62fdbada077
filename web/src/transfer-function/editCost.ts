/**
 * What an edit at a value makes be done again. Photons and tiles of paths remember the bins that they
 * relied on: then it is the share of those. Else it is the share of the volume in which the bin occurs.
 */

import type { Histogram, Method, StaleShares } from "../generated/proto";
import type { Range } from "./valueAxis";

/** A scalar bin that can be seen on the value axis. */
export interface CostBin {
  /** Data values. */
  low: number;
  high: number;
  /** Of what is redone, 0..1. */
  share: number;
  /** Of the volume, 0..1. */
  ofVolume: number;
}

/** What the methods remember of. */
const remembered: Partial<Record<Method, string>> = { photon_map: "photons", precomputed_transfer: "baked photons", path_traced: "tiles" };

/** The shares that were told, if they are of what this method keeps. */
export const sharesOf = (method: Method | undefined, told: StaleShares | null): StaleShares | null =>
  method !== undefined && told !== null && remembered[method] === told.what ? told : null;

/** Shares below this are too small for a number. */
const LEAST_PERCENT = 0.1;

/**
 * The bins in the order of their values. Data of few values leaves bins without width at the end:
 * only the last of them holds a value, the largest.
 */
export function costBins({ bin_edges: edges, bin_shares: shares }: Histogram, stale: StaleShares | null): CostBin[] {
  return shares.flatMap((ofVolume, bin) => {
    const [low, high] = [edges[bin], edges[bin + 1]];
    if (low === undefined || high === undefined) return [];
    const share = stale?.of_bins[bin] ?? ofVolume;
    return high > low || bin === shares.length - 1 ? [{ low, high, share, ofVolume }] : [];
  });
}

/** Neighbouring columns of the strip with the same shares. */
export interface CostRun {
  /** Columns, the last excluded. */
  from: number;
  to: number;
  share: number;
  ofVolume: number;
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
    const ofVolume = touched.reduce((most, bin) => Math.max(most, bin.ofVolume), 0);
    const before = runs.at(-1);
    if (before?.share === share && before.ofVolume === ofVolume) before.to = column + 1;
    else runs.push({ from: column, to: column + 1, share, ofVolume });
  }
  return runs;
}

/** How strongly a share is drawn, 0..1: the square root, so that one percent is still seen. */
export const strengthOf = (share: number): number => Math.sqrt(share);

/** A share of something in words. */
function shareInWords(share: number, whole: string): string {
  const percent = share * 100;
  if (percent === 0) return `none of the ${whole}`;
  if (percent < LEAST_PERCENT) return `less than ${LEAST_PERCENT} % of the ${whole}`;
  if (percent < 10) return `${Number(percent.toFixed(1))} % of the ${whole}`;
  return share === 1 ? `all of the ${whole}` : `${Math.min(99, Math.round(percent))} % of the ${whole}`;
}

/** What an edit costs, in words. */
export function costInWords({ share, ofVolume }: Pick<CostRun, "share" | "ofVolume">, stale: StaleShares | null): string {
  if (!stale) return ofVolume === 0 ? "touches nothing" : `touches ${shareInWords(ofVolume, "volume")}`;
  return `recomputes ${shareInWords(share, stale.what)}, for ${shareInWords(ofVolume, "volume")}`;
}

/** What the strip shows, in words. */
export const stripInWords = (stale: StaleShares | null): string =>
  stale ? `How many of the ${stale.what} an edit at each value makes be computed again` : "How much of the volume an edit at each value touches";
