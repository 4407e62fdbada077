/** How the page is arranged: kept in the browser, never part of the scene. */

import { create } from "zustand";
import { persist } from "zustand/middleware";
import type { OpacityAxis } from "../transfer-function/opacity";

/** Recent colours that are offered. */
const MAX_RECENT_COLOURS = 14;
/** Below this width panels are sheets over the picture, CSS pixels. */
export const NARROW_PIXELS = 900;

export type SectionId = "rendering" | "transfer" | "materials" | "lights" | "clip" | "quality" | "samples" | "mine";

export type Side = "left" | "right";

interface Kept {
  leftOpen: boolean;
  rightOpen: boolean;
  closedSections: SectionId[];
  statisticsOpen: boolean;
  logHistogram: boolean;
  /** The histogram is of what the clip region keeps. */
  histogramInView: boolean;
  opacityAxis: OpacityAxis;
  /** `#rrggbb`, newest first. */
  recentColours: string[];
}

interface Passing {
  /** The page is too narrow for panels beside the picture. */
  narrow: boolean;
  /** The panel that lies over the picture of a narrow page: one at a time. */
  sheet: Side | null;
  helpOpen: boolean;
  galleryOpen: boolean;
  turntableOpen: boolean;
  /** The dialog is about a film through saved views, not about a turntable. */
  filmChosen: boolean;
  /** Points of the transfer function, ascending. */
  selectedPoints: readonly number[];
  /** Clip box and planes are pulled in the picture. */
  clipHandles: boolean;
  /** Index of the light whose handles are shown. */
  selectedLight: number | null;
  /** What an edit has changed besides what was asked for; shown where it was asked for. */
  sideEffect: { at: "method" | "lights"; text: string } | null;
}

interface Actions {
  toggleSection: (id: SectionId) => void;
  togglePanel: (side: Side) => void;
  usedColour: (hex: string) => void;
}

const narrowPage = window.matchMedia(`(width < ${NARROW_PIXELS}px)`);

/** Whether a side panel is seen: beside the picture, or as a sheet over it. */
export const isOpen = (ui: Pick<Kept & Passing, "narrow" | "sheet" | "leftOpen" | "rightOpen">, side: Side): boolean =>
  ui.narrow ? ui.sheet === side : side === "left" ? ui.leftOpen : ui.rightOpen;

export const useUi = create<Kept & Passing & Actions>()(
  persist(
    (set) => ({
      leftOpen: true,
      rightOpen: true,
      closedSections: ["materials"],
      statisticsOpen: false,
      logHistogram: true,
      histogramInView: false,
      opacityAxis: "linear",
      recentColours: [],
      narrow: narrowPage.matches,
      sheet: null,
      helpOpen: false,
      galleryOpen: false,
      turntableOpen: false,
      filmChosen: false,
      selectedPoints: [],
      selectedLight: null,
      sideEffect: null,
      clipHandles: false,
      toggleSection: (id) => set(({ closedSections }) => ({
        closedSections: closedSections.includes(id) ? closedSections.filter((other) => other !== id) : [...closedSections, id],
      })),
      togglePanel: (side) => set((ui) => {
        if (ui.narrow) return { sheet: ui.sheet === side ? null : side };
        return side === "left" ? { leftOpen: !ui.leftOpen } : { rightOpen: !ui.rightOpen };
      }),
      usedColour: (hex) => set(({ recentColours }) => ({
        recentColours: [hex, ...recentColours.filter((other) => other !== hex)].slice(0, MAX_RECENT_COLOURS),
      })),
    }),
    {
      name: "tyndall.page",
      partialize: ({ closedSections, statisticsOpen, logHistogram, histogramInView, opacityAxis, recentColours, leftOpen, rightOpen }): Kept =>
        ({ closedSections, statisticsOpen, logHistogram, histogramInView, opacityAxis, recentColours, leftOpen, rightOpen }),
    },
  ),
);

narrowPage.addEventListener("change", ({ matches }) => useUi.setState({ narrow: matches, sheet: null }));
