import { expect, test } from "vitest";
import { whyNotExchanged } from "./records";

test("what keeps orders of scattering from the picture is told, and nothing where nothing does", () => {
  const product = (record_exchange: number) => ({ record_exchange, record_form: "product" as const });
  expect(whyNotExchanged(product(0), "all")).toContain("Without exchanges");
  expect(whyNotExchanged(product(0), 1)).toBeNull();
  expect(whyNotExchanged(product(3), "all")).toBeNull();
  expect(whyNotExchanged(product(3), 1)).toContain("no light");
  expect(whyNotExchanged(product(3), 3)).toContain("2 times");
  expect(whyNotExchanged(product(3), 4)).toBeNull();
  expect(whyNotExchanged({ record_exchange: 3, record_form: "isotropic" }, "all")).toContain("once");
});
