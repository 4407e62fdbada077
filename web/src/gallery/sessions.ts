/** The sessions of the service as people look for them. */

import type { Dataset, Session } from "../generated/proto";
import { labelOf } from "../quality/methods";
import { renderingModes } from "../quality/rendering";
import { datasetOf } from "../session/volumeFacts";

const MINUTE = 60_000;
const HOUR = 60 * MINUTE;
const DAY = 24 * HOUR;

const counted = (count: number, one: string): string => `${count} ${one}${count === 1 ? "" : "s"}`;

/** How long ago a time was, in words. */
export function agoInWords(then: number, now: number): string {
  const passed = Math.max(0, now - then);
  if (passed < MINUTE) return "just now";
  if (passed < HOUR) return `${counted(Math.floor(passed / MINUTE), "minute")} ago`;
  return passed < DAY ? `${counted(Math.floor(passed / HOUR), "hour")} ago` : `${counted(Math.floor(passed / DAY), "day")} ago`;
}

/** What a session shows: the name of its volume, and how it is drawn. */
export function contentOf({ scene }: Session, datasets: readonly Pick<Dataset, "id" | "name">[]): { name: string; drawn: string } {
  const id = datasetOf(scene.volume);
  const name = datasets.find((dataset) => dataset.id === id)?.name ?? id ?? "a volume";
  const { mode } = scene.rendering;
  const drawn = mode === "volume" ? labelOf(scene.illumination.method) : (renderingModes.find(({ value }) => value === mode)?.label ?? mode);
  return { name, drawn };
}

/** Who looks at a session. */
export function viewersInWords(viewers: number, mine: boolean): string {
  const others = viewers - (mine ? 1 : 0);
  if (mine) return others > 0 ? `you and ${counted(others, "other")}` : "only you";
  return viewers === 0 ? "nobody is looking" : counted(viewers, "viewer");
}

/** This page's own, by the identifier it is listed under, first; then those with most viewers, then the one used last. */
export const inOrder = (sessions: readonly Session[], own: string | null): Session[] =>
  [...sessions].sort((a, b) => Number(b.id === own) - Number(a.id === own) || b.viewers - a.viewers || b.used_unix_millis - a.used_unix_millis);
