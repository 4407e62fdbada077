/** The datasets the service offers, and the uploads of this page. */

import { create } from "zustand";
import { deleteDataset, getDatasets } from "../api/rest";
import { offer } from "../app/say";
import { useUi } from "../app/uiStore";
import type { Dataset, SceneFile } from "../generated/proto";
import { session } from "../session/engine";
import { looksLikeScene } from "../session/shareLink";
import { useSession } from "../session/store";
import { wordsOf } from "../session/words";
import { formatBytes } from "./format";
import { groupFiles, sidecarName, type Group, type RawLayout } from "./grouping";
import { stacksApart } from "./stacks";
import { startUpload, type Progress } from "./upload";

/** Largest JSON file that is looked into to see whether it is a scene. */
const MAX_SCENE_BYTES = 4_000_000;

export interface UploadTile {
  id: number;
  name: string;
  group: Group<File>;
  state:
    /** The layout of a raw file is asked for. */
    | { kind: "layout" }
    | { kind: "sending"; progress: Progress; cancel: () => void }
    /** Everything is sent; the service reads it. */
    | { kind: "checking"; cancel: () => void }
    | { kind: "done"; dataset: Dataset }
    | { kind: "failed"; message: string };
}

interface DatasetsState {
  list: Dataset[];
  /** Why the list is not there. */
  listError: string | null;
  uploads: UploadTile[];
  /** Dataset being opened. */
  opening: string | null;
  /** Why something about one dataset did not work. */
  datasetError: { id: string; message: string } | null;
}

export const useDatasets = create<DatasetsState>(() => ({ list: [], listError: null, uploads: [], opening: null, datasetError: null }));

const set = useDatasets.setState;
let lastUpload = 0;

export async function refreshDatasets(): Promise<void> {
  try {
    set({ list: await getDatasets(), listError: null });
  } catch (error) {
    set({ listError: wordsOf(error) });
  }
}

/** Opens a dataset; why it did not work is shown at its card, and returned. */
export async function explore(id: string): Promise<string | null> {
  set({ opening: id, datasetError: null });
  const before = useSession.getState();
  try {
    await session.openDataset(id);
    // Another dataset starts a scene of its own; the edited one is kept where the browser's Back leads.
    if (before.canUndo && before.dataset && useSession.getState().sessionId !== before.sessionId) {
      offer(`Your scene of ${before.dataset.name} is one step back.`, "Go back", () => window.history.back());
    }
    // On a narrow page the list lies over the picture that was asked for.
    useUi.setState({ sheet: null });
    return null;
  } catch (error) {
    const message = wordsOf(error);
    set({ datasetError: { id, message } });
    return message;
  } finally {
    set({ opening: null });
  }
}

export async function removeDataset(id: string): Promise<void> {
  try {
    await deleteDataset(id);
    set(({ list, uploads }) => ({
      list: list.filter((dataset) => dataset.id !== id),
      uploads: uploads.filter(({ state }) => state.kind !== "done" || state.dataset.id !== id),
      datasetError: null,
    }));
  } catch (error) {
    set({ datasetError: { id, message: wordsOf(error) } });
  }
}

/** Takes dropped or chosen files: a scene is opened, everything else uploaded. */
export async function takeFiles(files: readonly File[]): Promise<void> {
  const volumes: File[] = [];
  for (const file of files) {
    const scene = await sceneIn(file);
    if (scene) await session.openScene(scene);
    else volumes.push(file);
  }
  for (const group of (await Promise.all(groupFiles(volumes).map(stacksApart))).flat()) {
    const id = (lastUpload += 1);
    const tile: UploadTile = { id, name: group.name, group, state: { kind: "layout" } };
    set(({ uploads }) => ({ uploads: [tile, ...uploads] }));
    if (!group.needsLayout) void send(id, group.files);
  }
}

/** Uploads a raw file with a sidecar that states its layout. */
export function sendWithLayout(tile: UploadTile, layout: RawLayout): void {
  const sidecar = new File([JSON.stringify(layout)], sidecarName(tile.name), { type: "application/json" });
  void send(tile.id, [...tile.group.files, sidecar]);
}

export const retryUpload = (tile: UploadTile): void => {
  if (tile.group.needsLayout) update(tile.id, { kind: "layout" });
  else void send(tile.id, tile.group.files);
};

export const dismissUpload = (id: number): void => set(({ uploads }) => ({ uploads: uploads.filter((tile) => tile.id !== id) }));

async function send(id: number, files: readonly File[]): Promise<void> {
  const total = files.reduce((sum, file) => sum + file.size, 0);
  const most = useSession.getState().status?.max_upload_bytes;
  if (most !== undefined && total > most) {
    update(id, { kind: "failed", message: `The upload has ${formatBytes(total)}; this service takes at most ${formatBytes(most)}.` });
    return;
  }
  const upload = startUpload(files, (progress) => {
    const { cancel } = upload;
    update(id, progress.sent < progress.total ? { kind: "sending", progress, cancel } : { kind: "checking", cancel });
  });
  update(id, { kind: "sending", progress: { sent: 0, total, bytesPerSecond: 0 }, cancel: upload.cancel });
  try {
    const dataset = await upload.done;
    update(id, { kind: "done", dataset });
    await refreshDatasets();
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") dismissUpload(id);
    else update(id, { kind: "failed", message: wordsOf(error) });
  }
}

function update(id: number, state: UploadTile["state"]): void {
  set(({ uploads }) => ({ uploads: uploads.map((tile) => (tile.id === id ? { ...tile, state } : tile)) }));
}

async function sceneIn(file: File): Promise<SceneFile | null> {
  if (!/\.json$/i.test(file.name) || file.size > MAX_SCENE_BYTES) return null;
  try {
    const value: unknown = JSON.parse(await file.text());
    return looksLikeScene(value) ? value : null;
  } catch {
    // Not JSON after all: it is uploaded, and the service says what is wrong with it.
    return null;
  }
}
