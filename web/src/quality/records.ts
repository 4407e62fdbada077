/** Settings of image-based lighting, as its panel offers them. */

import type { RecordForm, RecordLookup } from "../generated/proto";

/** The server's bounds. */
export const MIN_RECORDS = 2;
export const MAX_RECORDS = 100;
export const MAX_BANDS = 6;
export const MAX_EXCHANGES = 64;

export const directionChoices: readonly { value: string; label: string }[] = [12, 48, 192, 768].map((count) => ({ value: String(count), label: String(count) }));

export const formChoices: readonly { value: RecordForm; label: string }[] = [
  { value: "product", label: "Light product" },
  { value: "isotropic", label: "Isotropic" },
  { value: "static", label: "Static" },
  { value: "dynamic", label: "Dynamic, by view" },
];

export const lookupChoices: readonly { value: RecordLookup; label: string }[] = [
  { value: "trilinear", label: "Interpolated" },
  { value: "containing", label: "One record" },
];
