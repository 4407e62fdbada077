/** Settings of image-based lighting, as its panel offers them. */

import type { Illumination, RecordForm, RecordLookup, SceneFile } from "../generated/proto";

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

/** What keeps orders of scattering from the picture, in words; null if nothing does. */
export function whyNotExchanged({ record_exchange: rounds, record_form: form }: Pick<Illumination, "record_exchange" | "record_form">, orders: SceneFile["scattering"]["orders"]): string | null {
  if (form !== "product") return "Records of this form scatter light once and follow it no further.";
  if (rounds === 0) return orders === 1 ? null : "Without exchanges image-based lighting scatters light once.";
  if (orders === 1) return "Scattering is single: records exchange no light.";
  return orders !== "all" && orders - 1 < rounds ? `Records exchange light ${orders - 1} times only: that makes the ${orders} orders.` : null;
}
