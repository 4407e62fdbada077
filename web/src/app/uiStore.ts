/** How the page is arranged: kept in the browser, never part of the scene. */

import { create } from "zustand";
import { persist } from "zustand/middleware";
import type { OpacityAxis } from "../transfer-function/opacity";

/** Recent colours that are offered. */
const MAX_RECENT_COLOURS = 14;
/** Below this width panels are sheets over the picture, CSS pixels. */
export const NARROW_PIXELS = 900;

export type SectionId = "transfer" | "materials" | "lights" | "clip" | "quality" | "samples" | "mine";

interface Kept {
  leftOpen: boolean;
  rightOpen: boolean;
  closedSections: SectionId[];
  statisticsOpen: boolean;
  logHistogram: boolean;
  opacityAxis: OpacityAxis;
  /** `#rrggbb`, newest first. */
  recentColours: string[];
}

interface Passing {
  helpOpen: boolean;
  selectedPoint: number | null;
  /** Index of the light whose handles are shown. */
  selectedLight: number | null;
}

interface Actions {
  toggleSection: (id: SectionId) => void;
  usedColour: (hex: string) => void;
}

export const useUi = create<Kept & Passing & Actions>()(
  persist(
    (set) => ({
      leftOpen: window.innerWidth >= NARROW_PIXELS,
      rightOpen: window.innerWidth >= NARROW_PIXELS,
      closedSections: ["materials"],
      statisticsOpen: false,
      logHistogram: true,
      opacityAxis: "linear",
      recentColours: [],
      helpOpen: false,
      selectedPoint: null,
      selectedLight: null,
      toggleSection: (id) => set(({ closedSections }) => ({
        closedSections: closedSections.includes(id) ? closedSections.filter((other) => other !== id) : [...closedSections, id],
      })),
      usedColour: (hex) => set(({ recentColours }) => ({
        recentColours: [hex, ...recentColours.filter((other) => other !== hex)].slice(0, MAX_RECENT_COLOURS),
      })),
    }),
    {
      name: "tyndall.page",
      partialize: ({ closedSections, statisticsOpen, logHistogram, opacityAxis, recentColours, leftOpen, rightOpen }): Partial<Kept> =>
        window.innerWidth < NARROW_PIXELS
          ? { closedSections, statisticsOpen, logHistogram, opacityAxis, recentColours }
          : { closedSections, statisticsOpen, logHistogram, opacityAxis, recentColours, leftOpen, rightOpen },
    },
  ),
);
