/** Settings of the photon map, as its panel offers them. */

import type { LightGather } from "../generated/proto";

export const gatherChoices: readonly { value: LightGather; label: string }[] = [
  { value: "field", label: "Light field" },
  { value: "ray", label: "Photons, exact" },
];
