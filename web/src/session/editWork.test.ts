import { describe, expect, it } from "vitest";
import { FLAG_FINAL, FLAG_MOVING } from "../generated/proto";
import { EditMeter } from "./editWork";

const photons = (redone: number, all = 1000) => ({ counters: { photons_recomputed: redone, photons_reused: all - redone, samples_taken: 5 } });

function edited(): EditMeter {
  const meter = new EditMeter();
  meter.sent(7, 1000);
  return meter;
}

/** A picture of input `seq` arrives, is reported about, and is shown. */
function picture(meter: EditMeter, frame: number, seq: number, redone: number, completeness: number, now: number, flags = FLAG_MOVING): void {
  meter.arrived({ frame, seq });
  meter.reported(frame, photons(redone));
  meter.shown({ seq, flags, illumination_completeness: completeness }, now);
}

describe("the newest edit", () => {
  it("is timed to its first picture, its whole light and its final picture", () => {
    const meter = edited();
    expect(meter.read()).toMatchObject({ seq: 7, firstMillis: null, kinds: [] });
    picture(meter, 1, 7, 100, 0.25, 1050);
    expect(meter.read()).toMatchObject({ firstMillis: 50, litMillis: null, finalMillis: null, completeness: 0.25 });
    picture(meter, 2, 7, 250, 1, 1200);
    picture(meter, 3, 8, 0, 1, 1500, FLAG_FINAL);
    expect(meter.read()).toMatchObject({ firstMillis: 50, litMillis: 200, finalMillis: 500, completeness: 1 });
    picture(meter, 4, 9, 0, 1, 2500, FLAG_FINAL);
    expect(meter.read()).toMatchObject({ finalMillis: 500 });
  });

  it("adds up what was redone, and what is left of all was reused", () => {
    const meter = edited();
    picture(meter, 1, 7, 100, 0.25, 1050);
    picture(meter, 2, 7, 250, 1, 1200);
    meter.arrived({ frame: 3, seq: 7 });
    meter.reported(3, { counters: {} });
    expect(meter.read()?.kinds).toEqual([{ name: "photons", redone: 350, reused: 650 }]);
    meter.reported(3, photons(900));
    expect(meter.read()?.kinds).toEqual([{ name: "photons", redone: 1250, reused: 0 }]);
  });

  it("counts segments where they are cast", () => {
    const meter = edited();
    for (const frame of [1, 2]) {
      meter.arrived({ frame, seq: 7 });
      meter.reported(frame, { counters: { segments_cast: 10, segments_reused: 30 } });
    }
    expect(meter.read()?.kinds).toEqual([{ name: "segments", redone: 20, reused: 60 }]);
  });

  it("is not told about by pictures of what was before, nor by pictures unknown", () => {
    const meter = edited();
    picture(meter, 1, 6, 100, 1, 1050, FLAG_FINAL);
    meter.reported(99, photons(5));
    expect(meter.read()).toMatchObject({ firstMillis: null, kinds: [] });
    picture(meter, 2, 7, 1, 1, 1100);
    meter.sent(8, 1200);
    expect(meter.read()).toMatchObject({ seq: 8, firstMillis: null, kinds: [] });
    meter.forget();
    expect(meter.read()).toBeNull();
  });
});
