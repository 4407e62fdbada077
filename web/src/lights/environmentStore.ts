/** The pictures of light that the service has; uploading one, removing one. */

import { create } from "zustand";
import { deleteEnvironment, getEnvironments, putEnvironment } from "../api/rest";
import type { Environment } from "../generated/proto";
import { wordsOf } from "../session/words";

interface EnvironmentState {
  /** Null until it has arrived. */
  list: Environment[] | null;
  /** Name of the file on its way. */
  uploading: string | null;
  /** Why the last wish was refused, in words. */
  problem: string | null;
}

export const useEnvironments = create<EnvironmentState>(() => ({ list: null, uploading: null, problem: null }));

const set = (state: Partial<EnvironmentState>): void => useEnvironments.setState(state);

export async function refreshEnvironments(): Promise<void> {
  try {
    set({ list: await getEnvironments() });
  } catch (error) {
    set({ problem: wordsOf(error) });
  }
}

/** Stores a file; null if it was refused, the reason is in `problem`. */
export async function takeEnvironment(file: File): Promise<Environment | null> {
  set({ uploading: file.name, problem: null });
  try {
    const taken = await putEnvironment(file.name, file);
    await refreshEnvironments();
    return taken;
  } catch (error) {
    set({ problem: `${file.name}: ${wordsOf(error)}` });
    return null;
  } finally {
    set({ uploading: null });
  }
}

export async function removeEnvironment(id: string): Promise<void> {
  set({ problem: null });
  try {
    await deleteEnvironment(id);
  } catch (error) {
    set({ problem: wordsOf(error) });
  }
  await refreshEnvironments();
}
