/** The page's one observable state. The scene in it is also what a share link carries. */

import { create } from "zustand";
import {
  FLAG_FINAL, FLAG_MOVING, type Camera, type Dataset, type DeviceInfo, type FrameHeader, type FrameReport, type Histogram,
  type Method, type Role, type SceneFile, type ShownVolume, type StaleShares, type Status,
} from "../generated/proto";
import type { EditWork } from "./editWork";
import type { Readings } from "./meters";

/** State of the connection to the session. */
export type LinkState =
  /** Nothing asked for yet. */
  | "idle"
  /** A session is being opened or attached to for the first time. */
  | "connecting"
  | "open"
  /** Was open; comes back by itself. */
  | "lost"
  /** Cannot come back by itself; `failure` says why. */
  | "failed";

/** A refused edit, shown at the control concerned. */
export interface FieldError {
  /** Path of the field, for example `lights[1].position`. */
  field: string;
  message: string;
}

export interface SessionState {
  status: Status | null;
  sessionId: string | null;
  /** What this page may do in the session. */
  role: Role;
  device: DeviceInfo | null;
  dataset: Dataset | null;
  /** Of `dataset`; null until it has arrived. */
  histogram: Histogram | null;
  /** What is shown of the volume; null: the whole of it at full resolution. */
  shown: ShownVolume | null;
  /** What is shown, edits on their way included; the camera is this viewer's. */
  scene: SceneFile | null;
  /** Where the R key goes back to. */
  startCamera: Camera | null;
  /** The start is a dataset's own view: it is drawn back until it fits a narrow viewport. */
  startFits: boolean;
  /** The server has answered every edit that `scene` contains. */
  settled: boolean;
  canUndo: boolean;
  canRedo: boolean;
  link: LinkState;
  /** When the next attempt to connect starts, milliseconds since 1970; null while none waits. */
  retryAt: number | null;
  /** Header of the picture on screen; null before the first. */
  frame: FrameHeader | null;
  /** The picture on screen, if any, belongs to the session before. */
  awaitingPicture: boolean;
  /** The newest report. */
  report: FrameReport | null;
  /** The newest report of a change: refining what it led to does not replace it. */
  changeReport: FrameReport | null;
  /** The newest report that came with a picture: a change that cannot be seen needs none. */
  pictureReport: FrameReport | null;
  /** What edits would make stale, of the newest final picture whose method remembers it. */
  staleShares: StaleShares | null;
  /** What compression left out of the newest compressed bake, relative; null before the first. */
  compressionError: number | null;
  /** Nothing is left to be baked of the light in the newest picture of a bake; it may be stored and compressed. */
  bakeIsMade: boolean;
  /** Since which epoch the scene that the server knows has its illumination method. */
  methodSince: { method: Method; epoch: number } | null;
  /** What became of this page's newest edit. */
  editWork: EditWork | null;
  /** Time until all of the light is there, milliseconds; null where it is, or cannot be told. */
  lightMillis: number | null;
  /** A long step under way on the server. */
  progress: { activity: string; fraction: number } | null;
  /** No input has been sent for a moment. */
  atRest: boolean;
  /** Something to know about what is shown, in words. */
  notice: string | null;
  /** What failed, in words; null when all is well. */
  failure: string | null;
  fieldError: FieldError | null;
  readings: Readings;
}

export const useSession = create<SessionState>(() => ({
  status: null,
  sessionId: null,
  role: "editor",
  device: null,
  dataset: null,
  histogram: null,
  shown: null,
  scene: null,
  startCamera: null,
  startFits: false,
  settled: false,
  canUndo: false,
  canRedo: false,
  link: "idle",
  retryAt: null,
  frame: null,
  awaitingPicture: true,
  report: null,
  changeReport: null,
  pictureReport: null,
  staleShares: null,
  compressionError: null,
  bakeIsMade: false,
  methodSince: null,
  editWork: null,
  lightMillis: null,
  progress: null,
  atRest: true,
  notice: null,
  failure: null,
  fieldError: null,
  readings: { latencyMillis: null, framesPerSecond: 0, megabitsPerSecond: 0 },
}));

/** Whether this page may look and not edit. */
export const isWatching = ({ role }: Pick<SessionState, "role">): boolean => role === "watcher";

/** What a report makes known: it may be of a change, of a picture, or of both. */
export function reported(report: FrameReport): Partial<SessionState> {
  const { transfer_rows: rows, transfer_compression_error_ppm: compression, transfer_made: made } = report.counters;
  return {
    report,
    ...(report.changes.length > 0 ? { changeReport: report } : {}),
    ...(report.stages.length > 0 ? { pictureReport: report } : {}),
    ...(rows !== undefined ? { compressionError: compression === undefined ? null : compression / 1e6, bakeIsMade: made !== undefined } : {}),
    ...(report.stale_shares ? { staleShares: report.stale_shares } : {}),
  };
}

/** What is known of the method's beginning once a scene of this epoch arrived. */
export const sinceEpoch = (before: SessionState["methodSince"], method: Method, epoch: number): NonNullable<SessionState["methodSince"]> =>
  before?.method === method ? before : { method, epoch };

/** Whether the picture on screen was drawn by the scene's method: the first ones after another was chosen were not, and what they tell of light is of the old one's. */
export const isInOwnLight = ({ frame, scene, methodSince }: Pick<SessionState, "frame" | "scene" | "methodSince">): boolean =>
  frame !== null && scene !== null && methodSince?.method === scene.illumination.method && frame.snapshot_epoch >= methodSince.epoch;

/** What the viewport shows, in one word; also its `data-state`. */
export type PictureState = "loading" | "offline" | "moving" | "refining" | "final";

export function pictureState({ link, frame, awaitingPicture, progress, atRest }: Pick<SessionState, "link" | "frame" | "awaitingPicture" | "progress" | "atRest">): PictureState {
  if (link === "lost" || link === "failed") return "offline";
  if (!frame || awaitingPicture || progress) return "loading";
  if (frame.flags & FLAG_FINAL) return "final";
  // At rest the reduced picture is what refining starts from.
  return frame.flags & FLAG_MOVING && !atRest ? "moving" : "refining";
}
