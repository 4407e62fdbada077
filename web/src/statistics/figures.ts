/** Figures of the status line and the statistics, from headers and reports. */

import type { FrameHeader, FrameReport, StageTime } from "../generated/proto";
import type { EditWork } from "../session/editWork";
import type { PictureState } from "../session/store";

/** The state of the picture in words. */
export function stateInWords(state: PictureState, frame: FrameHeader | null, samplesPerPixel: number): string {
  if (state !== "refining" || !frame) return { loading: "loading", offline: "offline", moving: "moving", refining: "refining", final: "final" }[state];
  return `refining ${refinedPercent(frame, samplesPerPixel)} %`;
}

/** Share of the samples a final picture has, whole percent; 100 only when it is final. A reduced picture has few pixels. */
export function refinedPercent(frame: FrameHeader, samplesPerPixel: number): number {
  const pixels = (frame.width * frame.height) / Math.max(1, frame.viewport_width * frame.viewport_height);
  return Math.min(99, Math.floor((frame.samples_per_pixel / Math.max(1, samplesPerPixel)) * pixels * 100));
}

/** Share of the samples that empty space saved, 0..1; null where the report does not count them. */
export function skippedShare(report: FrameReport | null): number | null {
  const { samples_skipped: skipped, samples_taken: taken } = report?.counters ?? {};
  if (skipped === undefined || taken === undefined || skipped + taken === 0) return null;
  return skipped / (skipped + taken);
}

/** Share of what is kept between edits (photons, tiles or view-ray segments) that outlived the last one, 0..1; null where nothing is. */
export function reusedShare(report: FrameReport | null): number | null {
  const counters = report?.counters ?? {};
  const reused = counters.photons_reused ?? counters.tiles_reused ?? counters.segments_reused;
  const redone = counters.photons_recomputed ?? counters.tiles_recomputed ?? counters.segments_cast;
  if (reused === undefined || redone === undefined || reused + redone === 0) return null;
  return reused / (reused + redone);
}

/** The newest edit's times on screen: its first picture and its final one, or as far as they are there. */
export function editTimes(work: EditWork | null): string {
  if (!work || work.firstMillis === null) return "–";
  return `${millisInWords(work.firstMillis)} / ${work.finalMillis === null ? "…" : millisInWords(work.finalMillis)}`;
}

const millisInWords = (millis: number): string => (millis < 1000 ? `${Math.round(millis)} ms` : `${(millis / 1000).toPrecision(3)} s`);

/** Share of what was kept that the newest edit left as it was: of light if it is kept, else of the picture; null where nothing is. */
export function keptShare(work: EditWork | null): number | null {
  const [first] = work?.kinds ?? [];
  return first ? first.reused / Math.max(1, first.reused + first.redone) : null;
}

/** What became of the newest edit, in rows. */
export function editRows({ firstMillis, litMillis, finalMillis, completeness, kinds }: EditWork): [string, string][] {
  const time = (millis: number | null, waiting: string): string => (millis === null ? waiting : millisInWords(millis));
  return [
    ["first picture", time(firstMillis, "on its way")],
    ["all of the light", time(litMillis, `${Math.floor(completeness * 100)} % of it`)],
    ["final picture", time(finalMillis, "on its way")],
    ...kinds.map(({ name, redone, reused }): [string, string] => [name, `${formatCount(redone)} redone, ${formatCount(reused)} reused`]),
  ];
}

/** How much of the light is that of the scene on screen; null when all of it is. */
export const lightPercent = (frame: Pick<FrameHeader, "illumination_completeness"> | null): number | null =>
  frame && frame.illumination_completeness < 1 ? Math.floor(frame.illumination_completeness * 100) : null;

/** How much of the light is that of the scene on screen, and how long the rest takes where that is known; null when all of it is there. */
export function lightInWords(frame: Pick<FrameHeader, "illumination_completeness"> | null, remainingMillis: number | null): string | null {
  const percent = lightPercent(frame);
  if (percent === null) return null;
  return remainingMillis === null ? `${percent} %` : `${percent} %, ${timeLeft(remainingMillis)} left`;
}

/** A time to wait: whole seconds, or minutes. */
function timeLeft(millis: number): string {
  const seconds = Math.max(1, Math.round(millis / 1000));
  return seconds < 100 ? `${seconds} s` : `${Math.round(seconds / 60)} min`;
}

/** Whether the light on screen is that of the scene before an edit: the newest one's is on its way. */
export const showsOldLight = (frame: Pick<FrameHeader, "illumination_completeness" | "illumination_epoch" | "snapshot_epoch"> | null): boolean =>
  frame !== null && frame.illumination_completeness < 1 && frame.illumination_epoch < frame.snapshot_epoch;

/** What the statistics put first: what the last change was, or why the first picture was drawn. */
export function headline(change: FrameReport | null, newest: FrameReport | null): string {
  if (change) return `Last change: ${change.changes.join(", ")}`;
  return newest ? "Nothing has been changed yet" : "No picture yet";
}

/** The passes that ran, each with its reason. */
export const passesRun = ({ plan }: FrameReport): string[] =>
  plan.filter((pass) => pass.runs).map((pass) => `${words(pass.pass)}: ${pass.reason}`);

/** The time of a stage: by the wall, and where the device has a clock, of its work alone. */
export const stageTime = ({ millis, device_millis }: StageTime): string =>
  `${millis.toFixed(2)} ms${device_millis === undefined ? "" : `, device ${device_millis.toFixed(2)} ms`}`;

/** A count in few characters: 1234567 gives 1.23 M. */
export function formatCount(count: number): string {
  const units = ["", " k", " M", " G", " T"];
  const power = Math.min(units.length - 1, Math.max(0, Math.floor(Math.log10(Math.max(1, count)) / 3)));
  return power === 0 ? String(count) : `${(count / 1000 ** power).toPrecision(3)}${units[power] ?? ""}`;
}

/** `samples_taken` as people write it. */
export const words = (name: string): string => name.replaceAll("_", " ");
