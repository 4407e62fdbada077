/** The export of this page: asked for, followed while it is drawn, cancelled. It goes on while its dialog is closed. */

import { create } from "zustand";
import { deleteExport, getExport, postExport } from "../api/rest";
import type { Export, ExportRequest } from "../generated/proto";
import { wordsOf } from "../session/words";
import { isUnderWay } from "./turntable";

/** How often it is asked how far an export has come, milliseconds. */
const ASK_MILLIS = 500;

interface TurntableState {
  /** Null before one was asked for. */
  job: Export | null;
  /** It goes through views, and not around. */
  film: boolean;
  /** Why there is none, in words. */
  problem: string | null;
}

export const useTurntable = create<TurntableState>(() => ({ job: null, film: false, problem: null }));

const set = (state: Partial<TurntableState>): void => useTurntable.setState(state);

/** Whether this is still the export that the page is about. */
const isCurrent = (id: string): boolean => useTurntable.getState().job?.id === id;

/** Begins an export and follows it to its end. */
export async function beginTurntable(sessionId: string, request: ExportRequest): Promise<void> {
  set({ problem: null });
  try {
    const job = await postExport(sessionId, request);
    set({ job, film: request.keys !== undefined });
    await follow(job.id);
  } catch (error) {
    set({ problem: wordsOf(error) });
  }
}

async function follow(id: string): Promise<void> {
  while (isCurrent(id) && isUnderWay(useTurntable.getState().job)) {
    await new Promise((done) => window.setTimeout(done, ASK_MILLIS));
    if (!isCurrent(id)) return;
    const job = await getExport(id);
    if (isCurrent(id)) set({ job });
  }
}

/** Stops the export, if it is under way, and forgets it. */
export async function dropTurntable(): Promise<void> {
  const { job } = useTurntable.getState();
  set({ job: null, problem: null });
  if (!job) return;
  try {
    await deleteExport(job.id);
  } catch (error) {
    set({ problem: wordsOf(error) });
  }
}
