/** A film: the views that its camera comes through, and when. */

import type { Camera, CameraKey, ExportRequest } from "../generated/proto";
import { framesRefusal, type TurntableSettings } from "./turntable";

export interface SavedView {
  /** Tells views apart; of no other meaning. */
  id: number;
  camera: Camera;
  /** Time from the view before, seconds; of the first it is kept for when it is moved down. */
  seconds: number;
}

/** What the service takes. */
export const FILM_LIMITS = { views: 64, seconds: { min: 0.1, max: 600 }, wholeSeconds: 3600 } as const;
/** Time from view to view that is suggested, seconds. */
const SUGGESTED_SECONDS = 2;

export const withView = (views: readonly SavedView[], camera: Camera): SavedView[] =>
  [...views, { id: 1 + Math.max(0, ...views.map(({ id }) => id)), camera, seconds: SUGGESTED_SECONDS }];

export const withoutView = (views: readonly SavedView[], id: number): SavedView[] => views.filter((view) => view.id !== id);

/** Moves a view by so many places, as far as there are places. */
export function movedView(views: readonly SavedView[], id: number, by: number): SavedView[] {
  const moved = [...views];
  const from = moved.findIndex((view) => view.id === id);
  const to = Math.min(moved.length - 1, Math.max(0, from + by));
  if (from >= 0) moved.splice(to, 0, ...moved.splice(from, 1));
  return moved;
}

export const withSeconds = (views: readonly SavedView[], id: number, seconds: number): SavedView[] =>
  views.map((view) => (view.id === id ? { ...view, seconds } : view));

export const filmSeconds = (views: readonly SavedView[]): number => views.slice(1).reduce((sum, { seconds }) => sum + seconds, 0);

/** Views with the times that they are reached at. */
export function keysOf(views: readonly SavedView[]): CameraKey[] {
  return views.map(({ camera }, index) => ({ seconds: filmSeconds(views.slice(0, index + 1)), camera }));
}

/** The last picture is the last view: one more than the pictures between. */
export const filmFrames = (views: readonly SavedView[], { framesPerSecond }: Pick<TurntableSettings, "framesPerSecond">): number =>
  Math.round(filmSeconds(views) * framesPerSecond) + 1;

/** Why the service would refuse, in words; null if it would not. */
export function filmRefusal(views: readonly SavedView[], settings: TurntableSettings): string | null {
  const [first] = views;
  if (!first || views.length < 2) return "A film needs two views or more.";
  if (views.length > FILM_LIMITS.views) return `At most ${FILM_LIMITS.views} views: remove some.`;
  const flat = ({ camera }: SavedView): boolean => camera.orthographic_height !== undefined;
  const other = views.findIndex((view) => flat(view) !== flat(first));
  if (other > 0) return `View ${other + 1} is ${flat(first) ? "with" : "without"} perspective and the first is not so: all must be alike.`;
  if (filmSeconds(views) > FILM_LIMITS.wholeSeconds) return "A film lasts an hour at most.";
  return framesRefusal(filmFrames(views, settings));
}

export function filmInWords(views: readonly SavedView[], settings: TurntableSettings): string {
  return `${filmFrames(views, settings)} pictures of ${settings.width} × ${settings.height} in ${Number(filmSeconds(views).toFixed(1))} s`;
}

export function filmRequest(views: readonly SavedView[], settings: TurntableSettings): ExportRequest {
  const { framesPerSecond, width, height, samples, format } = settings;
  return { keys: keysOf(views), frames: filmFrames(views, settings), frames_per_second: framesPerSecond, width, height, samples, format };
}
