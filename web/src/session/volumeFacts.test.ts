import { describe, expect, it } from "vitest";
import type { ShownVolume, VolumeSource } from "../generated/proto";
import { useSession } from "./store";
import { VolumeFacts } from "./volumeFacts";

const source: VolumeSource = { file: "a.nrrd", filter: "linear" };
const half: ShownVolume = { level: 1, dims: [8, 8, 8], whole_dims: [16, 16, 16], notice: "shown at 1/2 resolution" };

describe("what is shown of a volume", () => {
  it("comes with the greeting and with every scene", () => {
    const facts = new VolumeFacts();
    facts.greeted(source, null, half);
    expect(useSession.getState().shown).toEqual(half);
    const region: VolumeSource = { ...source, region: [[0, 0, 0], [0.5, 0.5, 0.5]] };
    const full = { ...half, level: 0, region: region.region, notice: "region shown at full resolution" };
    facts.scene(region, full);
    expect(useSession.getState().shown).toEqual(full);
    facts.scene(source);
    expect(useSession.getState().shown).toBeNull();
  });

  it("is forgotten with the session", () => {
    const facts = new VolumeFacts();
    facts.greeted(source, null, half);
    facts.forget();
    expect(useSession.getState().shown).toBeNull();
  });
});
