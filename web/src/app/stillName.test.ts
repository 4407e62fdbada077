import { expect, it } from "vitest";
import { stillName } from "./stillName";

it("names a still by what is shown, how, and when", () => {
  const at = new Date(2026, 10, 2, 8, 15, 2);
  expect(stillName("head", "slice", at)).toBe("head-slice-20261102-081502.png");
  expect(stillName("head", "volume", at)).toBe("head-20261102-081502.png");
});
