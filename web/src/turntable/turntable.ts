/** A turntable: the camera goes around its target, and the pictures become one file. */

import type { Camera, Export, ExportRequest } from "../generated/proto";
import { add, clamp, normalize, rotate, sub } from "../scene/vec";

/** What can be chosen. */
export interface TurntableSettings {
  /** Longer than a whole turn, or negative for the other way. */
  turns: number;
  seconds: number;
  framesPerSecond: number;
  /** Pixels. */
  width: number;
  height: number;
  /** Samples or paths per pixel. */
  samples: number;
  format: ExportRequest["format"];
}

/** What the service takes. */
export const LIMITS = { frames: { min: 2, max: 1440 }, rate: { min: 1, max: 60 }, turns: 10, edge: 4096, samples: 4096 } as const;

/** Longest edge of the pictures that are suggested, pixels. */
const SUGGESTED_EDGE = 960;

/** What is suggested for a viewport of this size, device pixels, and a scene of so many samples at rest. */
export function suggested(viewport: { width: number; height: number }, samplesAtRest: number): TurntableSettings {
  const shrink = Math.min(1, SUGGESTED_EDGE / Math.max(1, viewport.width, viewport.height));
  const edge = (pixels: number): number => Math.max(1, Math.round(pixels * shrink));
  return { turns: 1, seconds: 6, framesPerSecond: 24, width: edge(viewport.width), height: edge(viewport.height), samples: clamp(samplesAtRest, 1, LIMITS.samples), format: "apng" };
}

export const framesOf = ({ seconds, framesPerSecond }: Pick<TurntableSettings, "seconds" | "framesPerSecond">): number => Math.round(seconds * framesPerSecond);

/** Why the service would refuse so many pictures, in words; null if it would not. */
export function framesRefusal(frames: number): string | null {
  if (frames < LIMITS.frames.min) return `That is ${frames === 1 ? "one picture" : "no picture"}: make it longer.`;
  if (frames > LIMITS.frames.max) return `That is ${frames} pictures, at most ${LIMITS.frames.max} are drawn: make it shorter, or fewer a second.`;
  return null;
}

/** Why the service would refuse, in words; null if it would not. */
export function refusal(settings: TurntableSettings): string | null {
  const refused = framesRefusal(framesOf(settings));
  if (refused !== null) return refused;
  if (settings.turns === 0) return "Without a turn all pictures are the same.";
  return null;
}

/** What will be drawn, in words. */
export function inWords(settings: TurntableSettings): string {
  const frames = framesOf(settings);
  const degrees = Math.abs(settings.turns) * 360 / Math.max(1, frames);
  return `${frames} pictures of ${settings.width} × ${settings.height}, one every ${Number(degrees.toPrecision(2))}°`;
}

export function requestOf(settings: TurntableSettings, camera: Camera): ExportRequest {
  const { turns, framesPerSecond, width, height, samples, format } = settings;
  return { turns, frames: framesOf(settings), frames_per_second: framesPerSecond, width, height, samples, format, camera };
}

/** The camera after a share of a turn about its upright axis, right-handed. */
export function turned(camera: Camera, turns: number): Camera {
  const target = camera.target;
  const arm = rotate(sub(camera.position, target), normalize(camera.up, [0, 1, 0]), turns * 2 * Math.PI);
  return { ...camera, position: add(target, arm) };
}

/** A time that is left, in words. */
export function timeInWords(seconds: number): string {
  if (seconds < 90) return `${Math.max(1, Math.round(seconds))} s`;
  const minutes = Math.round(seconds / 60);
  return minutes < 90 ? `${minutes} min` : `${Number((seconds / 3600).toPrecision(2))} h`;
}

/** Where an export is, in words. */
export function progressInWords({ state, frames_done, frames, seconds_left }: Pick<Export, "state" | "frames_done" | "frames" | "seconds_left">): string {
  if (state === "waiting") return "Waiting for another export to end …";
  const left = seconds_left === undefined ? "" : `, about ${timeInWords(seconds_left)} left`;
  return `${frames_done} of ${frames} pictures${left}`;
}

export const isUnderWay = (job: Pick<Export, "state"> | null): boolean => job !== null && (job.state === "waiting" || job.state === "drawing");
