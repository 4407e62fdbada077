import { expect, test } from "vitest";
import { valueAfterKey } from "./sliderKeys";

const whole = { unit: 1, min: 1, max: 4096 };
/** Positions by powers of two, as sliders of counts have them. */
const press = (value: number, places: number, bounds = whole) => {
  const from = Math.log2(value);
  const to = Math.min(Math.max(from + places, 0), 8);
  return valueAfterKey(value, Math.round(2 ** to), [from, to], bounds);
};

test("a key changes a count by at least one", () => {
  expect(Math.round(2 ** (Math.log2(2) + 0.02)), "rounding would take it back").toBe(2);
  expect(press(2, 0.02)).toBe(3);
  expect(press(3, -0.02)).toBe(2);
  expect(press(1, 0.02)).toBe(2);
  let value = 1;
  for (let key = 0; key < 40; key += 1) value = press(value, 0.02);
  expect(value).toBe(41);
});

test("a key goes further where the slider does", () => {
  expect(press(200, 0.02)).toBe(203);
  expect(press(200, -0.02)).toBe(197);
  expect(press(40, 9), "End").toBe(256);
  expect(press(40, -9), "Home").toBe(1);
});

test("at its ends a slider leaves the value alone, inside and beyond", () => {
  expect(press(1, -0.02)).toBe(1);
  expect(press(256, 0.02)).toBe(256);
  expect(valueAfterKey(2000, 4096, [12, 12], whole), "below the slider").toBe(2000);
});

test("what is no count goes where the slider goes", () => {
  expect(valueAfterKey(0.1, 0.101, [-1, -0.99], { unit: 0, min: 1e-5, max: 0.5 })).toBe(0.101);
});
