/**
 * Sessions that this browser may edit. The service lists sessions by the identifier for watching alone;
 * the one for editing is known to those who opened a session, or were given a link to it.
 */

import type { Session } from "../generated/proto";

const KEY = "tyndall.sessions";
/** Most that are remembered; the oldest go first. */
const MAX_REMEMBERED = 100;

/** Identifiers for watching, each with that for editing. */
type Remembered = [watch: string, edit: string][];

function load(): Remembered {
  try {
    const kept: unknown = JSON.parse(window.localStorage.getItem(KEY) ?? "[]");
    return Array.isArray(kept) ? kept.filter((pair): pair is [string, string] => Array.isArray(pair) && pair.length === 2 && pair.every((id) => typeof id === "string")) : [];
  } catch {
    return []; // Storage is forbidden or damaged: links still work.
  }
}

/** Remembers a session that was opened for editing. */
export function rememberSession({ id, role, watch }: Pick<Session, "id" | "role" | "watch">): void {
  if (role !== "editor" || watch === undefined) return;
  const others = load().filter(([known]) => known !== watch);
  try {
    window.localStorage.setItem(KEY, JSON.stringify([...others, [watch, id]].slice(-MAX_REMEMBERED)));
  } catch {
    // Storage is full or forbidden: the session is listed as one to watch.
  }
}

/** The identifier for editing a listed session; null where this browser may only watch it. */
export const editableId = (watch: string): string | null => load().find(([known]) => known === watch)?.[1] ?? null;

/** The identifier under which a session is listed, given the one it is open by. */
export const listedId = (id: string): string => load().find(([, edit]) => edit === id)?.[0] ?? id;
