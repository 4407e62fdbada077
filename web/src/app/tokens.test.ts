import { describe, expect, it } from "vitest";
import tokens from "./tokens.css?raw";

/** Smallest contrast of text (WCAG 2.2, AA). */
const TEXT_CONTRAST = 4.5;

/** The colours of a theme, `#rrggbb` only. */
function theme(selector: string): Map<string, string> {
  const block = new RegExp(`\\[data-mantine-color-scheme="${selector}"\\]\\s*\\{([^}]*)\\}`).exec(tokens)?.[1] ?? "";
  return new Map([...block.matchAll(/--([\w-]+):\s*(#[0-9a-f]{6});/g)].map(([, name = "", hex = ""]) => [name, hex]));
}

function luminance(hex: string): number {
  const channel = (at: number) => {
    const c = parseInt(hex.slice(at, at + 2), 16) / 255;
    return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  };
  return 0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5);
}

function contrast(a: string, b: string): number {
  const [bright = 0, dark = 0] = [luminance(a), luminance(b)].sort((x, y) => y - x);
  return (bright + 0.05) / (dark + 0.05);
}

describe.each(["dark", "light"])("the %s theme", (name) => {
  const colours = theme(name);
  const texts = ["text", "text-dim", "text-faint", "accent", "danger", "warning", "good"];
  const grounds = ["surface-panel", "surface-raised", "surface-field"];

  it.each(texts.flatMap((text) => grounds.map((ground) => [text, ground] as const)))("%s can be read on %s", (text, ground) => {
    expect(contrast(colours.get(text) ?? "", colours.get(ground) ?? "")).toBeGreaterThanOrEqual(TEXT_CONTRAST);
  });

  it("has neutral greys and a readable accent button", () => {
    for (const ground of grounds) expect(new Set(colours.get(ground)?.slice(1).match(/../g))).toHaveProperty("size", 1);
    expect(contrast(colours.get("on-accent") ?? "", colours.get("accent") ?? "")).toBeGreaterThanOrEqual(TEXT_CONTRAST);
  });
});

describe("the comparison", () => {
  it("fails for greys too close", () => {
    expect(contrast("#777777", "#888888")).toBeLessThan(TEXT_CONTRAST);
    expect(contrast("#000000", "#ffffff")).toBeCloseTo(21, 9);
  });
});
