/** Colour maps of the package d3-scale-chromatic: perceptual ones, and Cynthia Brewer's. */

import {
  interpolateBlues, interpolateBrBG, interpolateCividis, interpolateCubehelixDefault, interpolateGreens, interpolateGreys, interpolateInferno,
  interpolateMagma, interpolateOranges, interpolatePlasma, interpolatePuOr, interpolatePurples, interpolateRdBu, interpolateRdYlBu, interpolateReds,
  interpolateSpectral, interpolateTurbo, interpolateViridis, interpolateYlGnBu, interpolateYlOrRd,
} from "d3-scale-chromatic";
import { linearFromSrgb } from "../scene/colour";
import type { Triple } from "../scene/vec";
import type { ColourAt } from "./recolour";

export interface ColourMap {
  id: string;
  label: string;
  /** CSS colour at 0..1. */
  css: (t: number) => string;
}

const map = (id: string, css: (t: number) => string, label = id): ColourMap => ({ id, label, css });

export const colourMapGroups: readonly { label: string; maps: readonly ColourMap[] }[] = [
  {
    label: "Perceptual: even steps of the value look even",
    maps: [
      map("viridis", interpolateViridis, "Viridis"), map("magma", interpolateMagma, "Magma"), map("inferno", interpolateInferno, "Inferno"),
      map("plasma", interpolatePlasma, "Plasma"), map("cividis", interpolateCividis, "Cividis"), map("cubehelix", interpolateCubehelixDefault, "Cubehelix"),
      map("turbo", interpolateTurbo, "Turbo"),
    ],
  },
  {
    label: "ColorBrewer, from light to dark",
    maps: [
      map("Greys", interpolateGreys), map("Blues", interpolateBlues), map("Greens", interpolateGreens), map("Oranges", interpolateOranges),
      map("Reds", interpolateReds), map("Purples", interpolatePurples), map("YlOrRd", interpolateYlOrRd), map("YlGnBu", interpolateYlGnBu),
    ],
  },
  {
    label: "ColorBrewer, away from a middle",
    maps: [
      map("RdBu", interpolateRdBu), map("RdYlBu", interpolateRdYlBu), map("PuOr", interpolatePuOr), map("BrBG", interpolateBrBG), map("Spectral", interpolateSpectral),
    ],
  },
];

/** The linear colour of `rgb(r, g, b)` or `#rrggbb`. */
export function linearFromCss(css: string): Triple {
  const hex = /^#(..)(..)(..)$/.exec(css)?.slice(1).map((byte) => parseInt(byte, 16));
  const bytes = hex ?? css.match(/[\d.]+/g)?.map(Number) ?? [];
  return [0, 1, 2].map((i) => linearFromSrgb((bytes[i] ?? 0) / 255)) as Triple;
}

export const colourAtOf = ({ css }: ColourMap, reversed: boolean): ColourAt => (t) => linearFromCss(css(reversed ? 1 - t : t));

/** The map as a CSS background. */
export function cssGradient({ css }: ColourMap, reversed: boolean): string {
  const stops = Array.from({ length: 17 }, (_, i) => css((reversed ? 16 - i : i) / 16));
  return `linear-gradient(90deg, ${stops.join(", ")})`;
}
