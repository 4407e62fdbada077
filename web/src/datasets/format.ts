/** Sizes and datasets in words. */

import type { Dataset } from "../generated/proto";
import { formatValue } from "../transfer-function/valueAxis";

/** Bytes with a decimal unit. */
export function formatBytes(bytes: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  const power = Math.min(units.length - 1, Math.max(0, Math.floor(Math.log10(Math.max(1, bytes)) / 3)));
  const value = bytes / 1000 ** power;
  return `${power === 0 ? value : value.toPrecision(3)} ${units[power] ?? ""}`;
}

export const formatDims = (dims: readonly number[]): string => dims.join(" × ");

/** What was recognised, as name and value. */
export function facts(dataset: Dataset): [string, string][] {
  const unit = dataset.spacing_unit === undefined ? "" : ` ${dataset.spacing_unit}`;
  return [
    ["Format", dataset.format],
    ["Size", `${formatDims(dataset.dims)} voxels`],
    ["Spacing", `${dataset.spacing.map((length) => Number(length.toPrecision(4))).join(" × ")}${unit}`],
    ["Type", dataset.voxel_type],
    ["Range", `${formatValue(dataset.value_range[0])} to ${formatValue(dataset.value_range[1])}`],
    ["Axes", dataset.anatomical ? "anatomical (LPS)" : "as stored"],
    ["File", formatBytes(dataset.bytes)],
  ];
}
