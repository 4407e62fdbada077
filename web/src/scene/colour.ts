/** Linear colours of the scene file and the sRGB colours people pick. */

import { clamp, rounded, type Triple } from "./vec";

/** One linear channel to its sRGB value, 0..1 (IEC 61966-2-1). */
export function srgbFromLinear(channel: number): number {
  const c = clamp(channel, 0, 1);
  return c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
}

/** One sRGB channel, 0..1, to its linear value. */
export function linearFromSrgb(channel: number): number {
  const c = clamp(channel, 0, 1);
  return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
}

/** `#rrggbb` of a linear colour; channels above 1 are clipped. */
export function hexFromLinear(color: Triple): string {
  const byte = (c: number) => Math.round(srgbFromLinear(c) * 255).toString(16).padStart(2, "0");
  return `#${color.map(byte).join("")}`;
}

/** The linear colour of `#rrggbb`; null if the text is not one. */
export function linearFromHex(hex: string): Triple | null {
  const match = /^#?([0-9a-f]{2})([0-9a-f]{2})([0-9a-f]{2})$/i.exec(hex.trim());
  if (!match) return null;
  const channel = (text: string | undefined) => rounded(linearFromSrgb(parseInt(text ?? "0", 16) / 255), 5);
  return [channel(match[1]), channel(match[2]), channel(match[3])];
}

/** The largest channel: a light's strength. */
export const strengthOf = (color: Triple): number => Math.max(...color);

/** The colour with its largest channel at 1; white where it is black. */
export function hueOf(color: Triple): Triple {
  const strength = strengthOf(color);
  return strength > 0 ? [color[0] / strength, color[1] / strength, color[2] / strength] : [1, 1, 1];
}

/** A light's colour from its hue (any scale) and strength. */
export function withStrength(color: Triple, strength: number): Triple {
  const hue = hueOf(color);
  return [rounded(hue[0] * strength), rounded(hue[1] * strength), rounded(hue[2] * strength)];
}
