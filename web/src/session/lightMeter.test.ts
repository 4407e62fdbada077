import { expect, test } from "vitest";
import { LightMeter } from "./lightMeter";

const light = (share: number) => ({ illumination_completeness: share });

test("the rest of the light takes as long as what came did", () => {
  const meter = new LightMeter();
  expect(meter.read()).toBeNull();
  meter.shown(light(0.1), 0);
  expect(meter.read(), "one picture has no pace").toBeNull();
  meter.shown(light(0.3), 500);
  expect(meter.read(), "too soon").toBeNull();
  meter.shown(light(0.5), 1000);
  expect(meter.read()).toBeCloseTo(1250);
  meter.shown(light(0.5), 2000);
  expect(meter.read(), "it slows down").toBeCloseTo(3750);
});

test("other light begins anew, and light that is there takes no time", () => {
  const meter = new LightMeter();
  meter.shown(light(0.2), 0);
  meter.shown(light(0.8), 2000);
  meter.shown(light(0.05), 2400);
  expect(meter.read()).toBeNull();
  meter.shown(light(0.15), 3400);
  expect(meter.read()).toBeCloseTo(8500);
  meter.shown(light(1), 4000);
  expect(meter.read()).toBeNull();
  meter.shown(light(0.1), 4100);
  meter.shown(light(0.6), 6100);
  expect(meter.read()).not.toBeNull();
  meter.forget();
  expect(meter.read()).toBeNull();
});

test("what is long past says nothing of the pace", () => {
  const meter = new LightMeter();
  meter.shown(light(0.1), 0);
  meter.shown(light(0.2), 20_000);
  expect(meter.read()).toBeNull();
  meter.shown(light(0.4), 24_000);
  expect(meter.read()).toBeCloseTo(12_000);
});

test("what was there at once is no pace", () => {
  const meter = new LightMeter();
  meter.shown(light(0), 0);
  meter.shown(light(0.6), 300);
  meter.shown(light(0.61), 800);
  meter.shown(light(0.62), 1300);
  expect(meter.read()).toBeCloseTo(19_000);
});
