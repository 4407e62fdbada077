/** Undo and redo as patches, so that an undo touches only what the step had touched. */

import type { Patch } from "./mergePatch";

/** One thing a person did. */
export interface Step {
  /** Takes the step back. */
  undo: Patch;
  /** Does it again. */
  redo: Patch;
}

export interface History {
  past: readonly Step[];
  future: readonly Step[];
}

/** Steps that are kept; older ones are forgotten. */
export const MAX_STEPS = 200;

export const emptyHistory: History = { past: [], future: [] };

/** Adds a step; what had been undone is forgotten. */
export function record(history: History, step: Step): History {
  return { past: [...history.past, step].slice(-MAX_STEPS), future: [] };
}

/** Replaces the newest step: a later part of the same gesture. */
export function amend(history: History, step: Step): History {
  return { past: [...history.past.slice(0, -1), step], future: [] };
}

/** Drops the newest step: the server refused it. */
export function forgetLast(history: History): History {
  return { past: history.past.slice(0, -1), future: history.future };
}

/** The patch that takes the newest step back, and the history after it; null if there is none. */
export function undo(history: History): { history: History; patch: Patch } | null {
  const step = history.past.at(-1);
  if (!step) return null;
  return {
    history: { past: history.past.slice(0, -1), future: [step, ...history.future] },
    patch: step.undo,
  };
}

/** The patch that repeats the newest undone step, and the history after it; null if there is none. */
export function redo(history: History): { history: History; patch: Patch } | null {
  const [step, ...future] = history.future;
  if (!step) return null;
  return { history: { past: [...history.past, step], future }, patch: step.redo };
}
